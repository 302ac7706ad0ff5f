:- use_module(library(plunit)).
:- use_module('../../logic/terms').

hidden(at(_, _), [1]).

:- begin_tests(terms).

test(cost, [forall(member(Formula-Cost,
         [ formula(v0, red(v0))-1,
           formula(none, empty)-1,
           formula(v0, some(v1, o, on(v0, v1)))-2,
           formula(v0, some(v1, o, at(v1, v0)))-1,
           formula(v0, some(v1, o, conj(at(v1, v0), red(v1))))-2,
           formula(none, some(v0, o, red(v0)))-2,
           formula(v0, conj(conj(some(v1, o, on(v0, v1)), red(v1)), red(v0)))-3,
           formula(v0, some(v1, o, every(v2, o, implies(on(v0, v1), on(v2, v1)))))-3,
           formula(v0, implies(red(v0), empty))-3,
           formula(v0, closure(v1, v2, o, on(v1, v2), v0, v0))-2 ])),
             true(C == Cost)]) :-
    formula_cost(Formula, hidden, C).

test(rename_binds_fresh_variables, F-N == closure(v7, v8, o, conj(on(v7, v8), neg(red(v8))), v5, v6)-9) :-
    rename(closure(v1, v2, o, conj(on(v1, v2), neg(red(v2))), v3, v0), [v0-v6, v3-v5], F, 7, N).

test(rename_of_hidden_variables, F == conj(red(v5), some(v1, o, on(v1, v5)))) :-
    rename(conj(red(v0), some(v2, o, on(v2, v0))), [v0-v5], F, 1, _).

test(the_first_is_outermost, F == some(v1, o, some(v2, w, at(v1, v2)))) :-
    bind_some([v1-o, v2-w], at(v1, v2), F).

test(atoms_are_no_connectives, [forall(member(F, [on(v0, v1), empty, neg(_, _)])), fail]) :-
    connective(F, _).

:- end_tests(terms).
