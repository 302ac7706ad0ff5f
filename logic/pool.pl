:- module(pool,
          [ pool_grammar/1,         % +GrammarFiles
            pool_open/1,            % +FactsFile
            pool_level/1,           % +Cost
            pool_features/1,        % +Cost
            pool_formulas/1,        % +Cost
            pool_statistics/0
          ]).
:- use_module(facts).
:- use_module(engine).
:- use_module(rules).
:- use_module(generate).
:- use_module(features).
:- use_module(formula).

/** <module> The feature pool

    ?- pool_grammar(['grammar.lp']),
       pool_open('facts.pl'),
       forall(between(0, 3, Cost), pool_level(Cost)),
       forall(between(0, 3, Cost), pool_features(Cost)).

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
%   Print feature/3, size/2, pos/2, inc/2 and dec/2 for the representatives of this Cost.

pool_features(Cost) :-
    forall(representative(Id, Cost, Kind, Item, Pos, Inc, Dec),
           ( once(meta(Item, Size, _, _, _, _)),
             format("feature(~d,~d,~w). size(~d,~d).~n", [Id, Cost, Kind, Id, Size]),
             forall(bit(Pos, S), format("pos(~d,~d). ", [Id, S])),
             forall(( bit(Inc, B), transition_bit(B, T) ), format("inc(~d,~d). ", [Id, T])),
             forall(( bit(Dec, B), transition_bit(B, T) ), format("dec(~d,~d). ", [Id, T])),
             nl )).

%!  pool_formulas(+Cost:nonneg) is det.
%
%   Print formula/4 for the representatives of this Cost, one a line.

pool_formulas(Cost) :-
    forall(representative(Id, Cost, _, Item, _, _, _),
           ( item_formula(Item, Variable, Sort, Formula),
             print_fact(formula(Id, Variable, Sort, Formula)) )).

%!  pool_statistics is det.
%
%   Print what happened so far as stat(What, Number), one a line.

pool_statistics :-
    forall(( count(What, N) ; feature_count(What, N) ),
           print_fact(stat(What, N))).

print_fact(Fact) :-
    write_term(Fact, [quoted(true), ignore_ops(true)]),
    format(".~n").

bit(Bits, I) :-
    Bits =\= 0,
    First is lsb(Bits),
    (   I = First
    ;   Rest is Bits /\ (Bits - 1),
        bit(Rest, I)
    ).
