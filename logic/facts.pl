:- module(facts,
          [ read_facts/1,           % +File
            sort/1,                 % ?Sort
            predicate/2,            % ?Name, ?Sorts
            display/2,              % ?Name, ?Text
            spelling/2,             % +Name, -Text
            owner/3,                % ?Predicate, ?Sort, ?Position
            at_most_one/1,          % ?Predicate
            fluent/1,               % +Predicate
            state/2,                % ?State, ?Problem
            transition/3,           % ?Transition, ?From, ?To
            state_count/1,          % -Count
            entity_count/2,         % ?Sort, -Count
            entity_count/3,         % ?Problem, ?Sort, -Count
            problem_states/2,       % ?Problem, -States
            slot/4,                 % +Entity, +Problem, ?Sort, -Index
            tuple/4                 % +Predicate, -Problem, -States, -Arguments
          ]).
:- use_module(library(aggregate), [aggregate_all/3]).
:- use_module(library(apply), [foldl/4]).
:- use_module(library(error), [domain_error/2, existence_error/2, must_be/2]).
:- use_module(library(lists), [max_list/2, member/2, nth0/3, same_length/2]).
:- autoload(library(yall), [(>>)/5]).

/** <module> The training data: entities, states and what is true in them

    ?- read_facts('tests/logic/cup.pl'), tuple(on, Problem, States, Arguments).
    Problem = 0, States = 0b001, Arguments = [cup,t1].

Reads the facts that describe the demonstrations and numbers the entities: the I-th entity of a sort
in one problem shares slot I with the I-th entity of that sort in every other problem, so that one bit
vector covers all states of all problems.

The file is read term by term, never consulted: it cannot run anything.
*/

:- dynamic
    sort/1, predicate/2, display/2, owner/3, at_most_one/1, problem/1, transition/3,
    entity/3,                   % Problem, Sort, Entity
    static/3,                   % Name, Problem, Arguments
    fluent/3,                   % Name, State, Arguments
    state/2,                    % State, Problem
    state_count/1, entity_count/2, entity_count/3, problem_states/2, slot/4.

%!  sort(?Sort) is nondet.
%!  predicate(?Name, ?Sorts:list) is nondet.
%!  display(?Name, ?Text) is nondet.
%!  owner(?Predicate, ?Sort, ?Position) is nondet.
%!  at_most_one(?Predicate) is nondet.
%!  state(?State, ?Problem) is nondet.
%!  transition(?Transition, ?From, ?To) is nondet.
%
%   The facts as read. An entity of Sort at Position of Predicate is a stream's output, which determines the
%   other arguments; transitions lead from state to state.

%!  spelling(+Name, -Text) is det.
%
%   Text is how people read the predicate Name.

spelling(Name, Text) :-
    display(Name, Text),
    !.
spelling(Name, Name).

%!  state_count(-Count) is det.
%!  entity_count(?Sort, -Count) is nondet.
%!  entity_count(?Problem, ?Sort, -Count) is nondet.
%
%   How many states there are, and how many entities of Sort in the problem with most, or in Problem.

%!  problem_states(?Problem, ?States) is nondet.
%
%   States is the bit set of the states of Problem.

%!  slot(+Entity, +Problem, ?Sort, -Index) is semidet.
%
%   Entity is number Index (from 0) among the entities of Sort in Problem.

%!  read_facts(+File) is det.
%
%   Replace the data by the facts in File.
%
%   @error domain_error(training_fact, Term) for a term that is no such fact.

read_facts(File) :-
    clear,
    setup_call_cleanup(open(File, read, In, [encoding(utf8)]),
                       read_terms(In),
                       close(In)),
    number_states,
    number_entities,
    check_bounds.

clear :-
    forall(member(Name/Arity,
                  [ sort/1, predicate/2, display/2, owner/3, at_most_one/1, problem/1, transition/3,
                    entity/3, static/3, fluent/3, state/2,
                    state_count/1, entity_count/2, entity_count/3, problem_states/2, slot/4 ]),
           ( functor(Head, Name, Arity),
             retractall(Head) )).

read_terms(In) :-
    repeat,
    read_term(In, Term, []),
    (   Term == end_of_file
    ->  !
    ;   ground(Term),
        store(Term)
    ->  fail
    ;   domain_error(training_fact, Term)
    ).

store(sort(T)) :- assertz(sort(T)).
store(predicate(P, Sorts)) :- must_be(list(atom), Sorts), assertz(predicate(P, Sorts)).
store(display(P, Text)) :- assertz(display(P, Text)).
store(owner(P, T, I)) :- assertz(owner(P, T, I)).
store(at_most_one(P)) :- assertz(at_most_one(P)).
store(problem(P)) :- assertz(problem(P)).
store(entity(P, T, E)) :- assertz(entity(P, T, E)).
store(static(P, Atom)) :- known_atom(Atom, Name, Arguments), assertz(static(Name, P, Arguments)).
store(state(S, P)) :- must_be(nonneg, S), assertz(state(S, P)).
store(fluent(S, Atom)) :- known_atom(Atom, Name, Arguments), assertz(fluent(Name, S, Arguments)).
store(transition(T, S, S2)) :- must_be(nonneg, T), assertz(transition(T, S, S2)).

known_atom(Atom, Name, Arguments) :-
    Atom =.. [Name|Arguments],
    (   predicate(Name, Sorts),
        same_length(Sorts, Arguments)
    ->  true
    ;   length(Arguments, Arity),
        existence_error(predicate, Name/Arity)
    ).

number_states :-
    aggregate_all(count, state(_, _), Count),
    assertz(state_count(Count)),
    forall(( state(S, _), S >= Count ), domain_error(state_number, S)),
    forall(( transition(_, S, S2), member(X, [S, S2]), \+ state(X, _) ), existence_error(state, X)),
    forall(problem(P),
           ( findall(S, state(S, P), Ss),
             foldl([S, M0, M]>>(M is M0 \/ 1<<S), Ss, 0, Mask),
             assertz(problem_states(P, Mask)) )).

number_entities :-
    forall(( entity(_, T, _), \+ sort(T) ), existence_error(sort, T)),
    forall(sort(T),
           ( findall(N, ( problem(P), number_entities(P, T, N) ), Ns),
             max_list([0|Ns], Max),
             assertz(entity_count(T, Max)) )).

number_entities(P, T, N) :-
    findall(E, entity(P, T, E), Es),
    forall(nth0(I, Es, E), assertz(slot(E, P, T, I))),
    length(Es, N),
    assertz(entity_count(P, T, N)).

check_bounds :-
    forall(( at_most_one(Name), tuple(Name, P, States1, A1), tuple(Name, P, States2, A2), A1 @< A2 ),
           (   States1 /\ States2 =:= 0
           ->  true
           ;   domain_error(at_most_one(Name), A1-A2)
           )).

%!  fluent(+Predicate) is semidet.
%
%   Some tuple of Predicate is not true in all states of its problem.

fluent(Name) :-
    once(fluent(Name, _, _)).

%!  tuple(+Predicate, -Problem, -States, -Arguments) is nondet.
%
%   Predicate holds of Arguments in the given States (a bit set) of Problem.

tuple(Name, P, States, Arguments) :-
    static(Name, P, Arguments),
    problem_states(P, States).
tuple(Name, P, States, Arguments) :-
    fluent(Name, S, Arguments),
    state(S, P),
    States is 1<<S.
