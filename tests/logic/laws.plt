:- use_module(library(plunit)).
:- use_module(library(random)).
:- use_module('../../logic/facts').
:- use_module('../../logic/engine').
:- use_module('../../logic/rules').

% Every law of the shipped grammars holds for random denotations, and its right side costs no more.

open_data :-
    set_random(seed(1)),
    tmp_file_stream(File, Out, [encoding(utf8)]),
    forall(member(Fact, [ sort(o), sort(w), predicate(at, [o,w]), problem(0), problem(1),
                          entity(0, o, a), entity(0, o, b), entity(0, o, c), entity(0, w, p), entity(0, w, q),
                          entity(1, o, a), entity(1, o, b), entity(1, w, p),
                          state(0, 0), state(1, 0), state(2, 1), state(3, 1) ]),
           format(Out, "~q.~n", [Fact])),
    close(Out),
    read_facts(File),
    engine_setup,
    source_file(rules:load_grammars(_, _), Rules),
    file_directory_name(Rules, Folder),
    findall(Path, ( member(Name, [grammar, paper]), format(atom(Path), "~w/~w.lp", [Folder, Name]) ), Paths),
    load_grammars(Paths, []).

law(Name, Left, Right) :-
    rules:law_at(Name, Left, Right, _, _).

% typed(+Term, ?Class, -Typed, +Leaves0, -Leaves): Term with its classes, as leaf(Variable, Class) or
% apply(Rule, Classes, Class, Parts). Leaves are Variable-Class: a variable has one class.

typed(Variable, Class, leaf(Variable, Class), Leaves0, Leaves) :-
    var(Variable),
    !,
    (   member(Known-Class0, Leaves0),
        Known == Variable
    ->  Class = Class0,
        Leaves = Leaves0
    ;   Leaves = [Variable-Class|Leaves0]
    ).
typed(Term, Class, apply(Rule, Classes, Class, Parts), Leaves0, Leaves) :-
    Term =.. [Rule|Arguments],
    rules:rule_at(Rule, Classes, Class, _, _, _),
    typed_all(Arguments, Classes, Parts, Leaves0, Leaves).

typed_all([], [], [], Leaves, Leaves).
typed_all([A|As], [C|Cs], [P|Ps], Leaves0, Leaves) :-
    typed(A, C, P, Leaves0, Leaves1),
    typed_all(As, Cs, Ps, Leaves1, Leaves).

% instance(+Left, +Right, -Typed, -Class, -TypedRight): one way to type both sides, for all choices of sorts.
instance(Left, Right, Typed, Class, TypedRight) :-
    typed(Left, Class, Typed, [], Leaves),
    classes_in(Typed, Classes),
    term_variables(Classes, Sorts0),
    term_variables(Left, Operands),
    exclude([V]>>( member(W, Operands), V == W ), Sorts0, Sorts),
    maplist([S]>>member(S, [o,w]), Sorts),
    (   nonvar(Right),
        memberchk(Right, [true, false])
    ->  TypedRight = Right
    ;   typed(Right, _, TypedRight, Leaves, Leaves)
    ).

classes_in(leaf(_, C), [C]).
classes_in(apply(_, Cs, C, Parts), [C,Cs|More]) :-
    maplist(classes_in, Parts, More).

inner(pred(C), C) :- !.
inner(own(C), C) :- !.
inner(link(C), C) :- !.
inner(test(C), C) :- !.
inner(C, C).

value(leaf(V, Class0), Given, Given1, D) :-
    (   member(W-D0, Given),
        W == V
    ->  D = D0,
        Given1 = Given
    ;   inner(Class0, Class),
        mask(Class, Mask),
        Top is Mask + 1,
        random_between(0, Top, R),
        D is R /\ Mask,
        Given1 = [V-D|Given]
    ).
value(apply(Rule, Classes, Class, Parts), Given0, Given, D) :-
    foldl([Part, B, G0, G]>>value(Part, G0, G, B), Parts, Bits, Given0, Given),
    sem(Rule, Classes, Class, Bits, D).

same(true, Class, _, D) :- !, mask(Class, D).
same(false, _, _, D) :- !, D =:= 0.
same(Right, _, Given, D) :-
    value(Right, Given, _, D0),
    D =:= D0.

:- begin_tests(laws, [setup(open_data)]).

test(there_are_laws) :-
    aggregate_all(count, law(_, _, _), N),
    N > 15.

test(both_sides_agree, [forall(law(_, Left, Right)), nondet]) :-
    findall(instance(Typed, Class, Copy), instance(Left, Right, Typed, Class, Copy), Instances),
    Instances = [_|_],
    forall(( member(instance(Typed, Class, Copy), Instances), between(1, 20, _) ),
           agree(Typed, Class, Copy)).

test(a_wrong_law_is_noticed, fail) :-
    findall(instance(Typed, Class, Copy), instance(conj(A, negated(_)), A, Typed, Class, Copy), Instances),
    forall(( member(instance(Typed, Class, Copy), Instances), between(1, 20, _) ),
           agree(Typed, Class, Copy)).

agree(Typed, Class, Right) :-
    value(Typed, [], Given, D),
    same(Right, Class, Given, D).

:- end_tests(laws).
