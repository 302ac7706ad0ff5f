:- use_module(library(plunit)).
:- use_module(cup_pool).
:- use_module('../../logic/pool').
:- use_module('../../logic/features').

printed(Goal, Rows) :-
    with_output_to(string(Text), call(Goal)),
    split_string(Text, "\n", "", Rows0),
    exclude(==(""), Rows0, Rows).

fields(Rows, Fields) :-
    maplist([Row, F]>>split_string(Row, "\t", "", F), Rows, Fields).

:- begin_tests(pool, [setup(open_cup)]).

test(formulas_come_with_their_texts, [true, nondet]) :-
    printed(pool_formulas(1), Rows),
    fields(Rows, Fields),
    member([Id, "boolean", Term, "holding(x)"], Fields),
    format(string(Term), "formula(~s,v0,object,holding(v0)).", [Id]).

test(spelled_as_the_data_say, [true, nondet]) :-
    printed(pool_formulas(3), Rows),
    fields(Rows, Fields),
    member([_, _, _, Text], Fields),
    sub_string(Text, _, _, _, "∃y On(x,y) ∧ ").

test(every_feature_has_facts_a_formula_and_values, Numbers == [N,N,N]) :-
    aggregate_all(count, representative(_, _, _, _, _, _, _), N),
    findall(M,
            ( member(Goal, [pool_features, pool_formulas, pool_values]),
              findall(R, ( between(0, 3, Cost), call_with(Goal, Cost, Rows), member(R, Rows) ), All),
              length(All, M0),
              ( Goal == pool_features -> M is M0 // 2 ; M = M0 ) ),
            Numbers).

call_with(Goal, Cost, Rows) :-
    Call =.. [Goal,Cost],
    printed(user:Call, Rows).

test(a_formula_is_evaluated_and_found, [true, nondet]) :-
    printed(pool_formula("~ exists x: Holding(x)"), Rows),
    fields(Rows, Fields),
    memberchk(["formula", "formula(0,none,none,neg(some(v0,object,holding(v0)))).", "¬∃x holding(x)"], Fields),
    memberchk(["values", "1 0 1"], Fields),
    memberchk(["match", Match], Fields),
    split_string(Match, " ", "", [_, "complement"]).

test(a_formula_that_says_nothing, [true, nondet]) :-
    printed(pool_formula("exists y: Near(x,y)"), Rows),
    fields(Rows, Fields),
    memberchk(["match", "none constant"], Fields),
    memberchk(["satisfying", "1", "cup"], Fields).

test(statistics_are_facts) :-
    printed(pool_statistics, Rows),
    forall(member(Row, Rows), ( term_string(T, Row), memberchk(T, [stat(_, _), pruned(_, _, _, _)]) )).

:- end_tests(pool).
