:- module(pool,
          [ pool_grammar/1,         % +GrammarFiles
            pool_open/1,            % +FactsFile
            pool_level/1,           % +Cost
            pool_features/1,        % +Cost
            pool_formulas/1,        % +Cost
            pool_values/1,          % +Cost
            pool_satisfying/1,      % +State
            pool_formula/1,         % +Text
            pool_statistics/0
          ]).
:- use_module(library(aggregate), [aggregate_all/3]).
:- use_module(library(apply), [foldl/4, maplist/3]).
:- use_module(library(lists), [member/2, numlist/3, subtract/3]).
:- autoload(library(yall), [(>>)/5]).
:- use_module(concepts, [open_concepts/0, read_formula/4]).
:- use_module(engine, [count_bits/3, engine_setup/0, shape/3]).
:- use_module(evaluate, [denotation/4]).
:- use_module(facts, [read_facts/1, slot/4, spelling/2, state/2, state_count/1]).
:- use_module(features, [collect_features/1, feature_count/3, find_feature/4, representative/7, start_features/0,
                         transition_bit/2]).
:- use_module(formula, [item_formula/4]).
:- use_module(generate, [bucket/5, formula_count/1, generate_level/1, item/6, meta/6, rule_count/4,
                         start_generating/0]).
:- use_module(notation, [describe_formula/3]).
:- use_module(rules, [load_grammars/2]).
:- use_module(terms, [formula_cost/3]).

/** <module> The feature pool

    ?- pool_grammar(['logic/grammar.lp']), pool_open('tests/logic/cup.pl'),
       forall(between(0, 3, Cost), pool_level(Cost)),
       with_output_to(string(Printed), pool_formulas(1)), split_string(Printed, "\n", "", [First|_]).
    First = "1\tboolean\tformula(1,v0,object,holding(v0)).\tholding(x)".

reads a grammar (rules.pl) and training data (facts.pl), sees predicates as bit vectors (views.pl, engine.pl),
builds formulas up to a cost (generate.pl), keeps the features that behave differently (features.pl), and
prints them as facts that Prolog and clingo both read, with their formulas (formula.pl).
*/

%!  pool_grammar(+Files:list(atom)) is det.
%
%   Load the grammar, and print what is wrong with it as lines `File TAB Line TAB Column TAB Message`. It is
%   usable if nothing is printed.

pool_grammar(Files) :-
    load_grammars(Files, Diagnostics),
    forall(member(diagnostic(File, Line, Column, Message), Diagnostics),
           format("~w\t~d\t~d\t~s~n", [File, Line, Column, Message])).

%!  pool_open(+File) is det.
%
%   Load the training data and forget what was generated before.

pool_open(File) :-
    read_facts(File),
    engine_setup,
    open_concepts,
    start_generating,
    start_features.

%!  pool_level(+Cost:nonneg) is det.
%
%   Add the features of exactly this Cost. Levels are made in ascending order, starting with 0.

pool_level(Cost) :-
    generate_level(Cost),
    collect_features(Cost).

%!  pool_features(+Cost:nonneg) is det.
%
%   Print feature/3, size/2, pos/2, inc/2 and dec/2 for the representatives of this Cost, as ASP facts: pos(F,(1;4))
%   stands for pos(F,1) and pos(F,4).

pool_features(Cost) :-
    forall(representative(Id, Cost, Kind, Item, Pos, Inc, Dec),
           ( once(meta(Item, Size, _, _, _, _)),
             format("feature(~d,~d,~w). size(~d,~d).~n", [Id, Cost, Kind, Id, Size]),
             findall(S, bit(Pos, S), States),
             findall(T, ( bit(Inc, B), transition_bit(B, T) ), Rising),
             findall(T, ( bit(Dec, B), transition_bit(B, T) ), Falling),
             maplist(print_pooled(Id), [pos, inc, dec], [States, Rising, Falling]),
             nl )).

print_pooled(_, _, []) :- !.
print_pooled(Id, Name, Numbers) :-
    atomic_list_concat(Numbers, ;, Pooled),
    format("~w(~d,(~w)). ", [Name, Id, Pooled]).

%!  pool_formulas(+Cost:nonneg) is det.
%
%   Print lines `Id TAB Kind TAB formula(Id, Variable, Sort, Formula). TAB Text` for the representatives of this Cost;
%   Text is how people read the formula.

pool_formulas(Cost) :-
    forall(representative(Id, Cost, Kind, Item, _, _, _),
           ( item_formula(Item, Variable, Sort, Formula),
             format("~d\t~w\t", [Id, Kind]),
             print_formula(formula(Id, Variable, Sort, Formula)) )).

print_formula(Fact) :-
    Fact = formula(_, _, _, Formula),
    describe_formula(Formula, spelling, Text),
    write_fact(Fact),
    format("\t~w~n", [Text]).

%!  pool_values(+Cost:nonneg) is det.
%
%   Print lines `Id TAB Values` for the representatives of this Cost: the value of the feature in every state.

pool_values(Cost) :-
    forall(representative(Id, Cost, _, Item, _, _, _),
           ( item_value(Item, Planes),
             values_of(Planes, Values),
             print_row([Id], Values) )).

%!  pool_satisfying(+State:nonneg) is det.
%
%   Print lines `Id TAB Entities` for all representatives that count: what satisfies the feature in State.

pool_satisfying(State) :-
    forall(( representative(Id, _, _, Item, _, _, _),
             item_denotation(Item, Class, Bits),
             entities_in(Class, Bits, State, Entities) ),
           print_row([Id], Entities)).

%!  pool_formula(+Text) is det.
%
%   Read a feature (see notation.pl), evaluate it exactly, and find it in the pool. Prints lines of fields between
%   tabs: `formula`, a formula/4 with number 0, and how people read it; `cost`; `values` in all states; for each state
%   `satisfying`, the state and what satisfies (if it counts); and `match` with one of
%
%     - Id, `same_values`: the pool has a feature with these values (perhaps this one)
%     - Id, `same_behaviour`: one that is positive, rises and falls where this does
%     - Id, `complement`: one that is true where this is false
%     - none, `constant`: it has the same value in all states, which is of no use
%     - none, `absent`: nothing like it in the pool made so far
%
%   @error notation_error(Column, Message)

pool_formula(Text) :-
    read_formula(Text, Variable, Sort, Formula),
    write('formula\t'),
    print_formula(formula(0, Variable, Sort, Formula)),
    formula_cost(formula(Variable, Formula), hidden, Cost),
    print_row([cost], [Cost]),
    (   Variable == none
    ->  Free = [],
        Class = prop
    ;   Free = [Variable-Sort],
        Class = con(Sort)
    ),
    (   shape(Class, _, _)
    ->  denotation(Formula, Free, Class, Bits),
        count_bits(Class, Bits, Planes)
    ;   Bits = 0,
        Planes = []
    ),
    values_of(Planes, Values),
    print_row([values], Values),
    forall(entities_in(Class, Bits, State, Entities), print_row([satisfying,State], Entities)),
    find_feature(Class, Planes, Id, How),
    print_row([match], [Id,How]).

% hidden(+Atom, +Positions): some view shows all arguments of Atom but those at Positions.

hidden(Atom, Positions) :-
    functor(Atom, Name, Arity),
    numlist(1, Arity, All),
    subtract(All, Positions, Visible),
    meta(_, _, _, _, view(Name, Shown), _),
    msort(Shown, Visible),
    !.

item_denotation(Item, Class, Bits) :-
    item(Bucket, Item, _, _, _, Bits),
    !,
    bucket(Bucket, Class, _, _, _).

item_value(Item, Planes) :-
    item_denotation(Item, Class, Bits),
    count_bits(Class, Bits, Planes).

values_of(Planes, Values) :-
    state_count(N),
    Last is N-1,
    findall(Value,
            ( between(0, Last, S),
              foldl([P, W-V0, W2-V]>>( W2 is W*2, V is V0 + W * getbit(P, S) ), Planes, 1-0, _-Value) ),
            Values).

entities_in(con(Sort), Bits, State, Entities) :-
    state(State, Problem),
    state_count(S),
    findall(E,
            ( slot(E, Problem, Sort, I),
              Position is I*S + State,
              getbit(Bits, Position) =:= 1 ),
            Entities0),
    sort(Entities0, Entities).

%!  pool_statistics is det.
%
%   Print what happened so far, one fact a line: stat(What, Number) for formulas and features, and for each level
%   and rule, pruned(Level, Rule, What, Number); What is explained at rule_count/4 and feature_count/2. The rule
%   `features` stands for the last step, from formulas to features.

pool_statistics :-
    forall(rule_count(Level, Rule, What, N),
           print_fact(pruned(Level, Rule, What, N))),
    forall(feature_count(Level, What, N),
           print_fact(pruned(Level, features, What, N))),
    formula_count(Formulas),
    print_fact(stat(formulas, Formulas)),
    aggregate_all(count, representative(_, _, _, _, _, _, _), Features),
    print_fact(stat(features, Features)),
    aggregate_all(sum(N), rule_count(_, _, too_large, N), TooLarge),
    print_fact(stat(views_too_large, TooLarge)).

print_fact(Fact) :-
    write_fact(Fact),
    nl.

write_fact(Fact) :-
    write_term(Fact, [quoted(true), ignore_ops(true)]),
    write('.').

print_row(Fields, Words) :-
    forall(member(Field, Fields), format("~w\t", [Field])),
    atomic_list_concat(Words, ' ', Row),
    format("~w~n", [Row]).

bit(Bits, I) :-
    Bits =\= 0,
    First is lsb(Bits),
    (   I = First
    ;   Rest is Bits /\ (Bits - 1),
        bit(Rest, I)
    ).
