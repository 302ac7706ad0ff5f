:- use_module(library(plunit)).
:- use_module(cup_pool).
:- use_module('../../logic/facts').
:- use_module('../../logic/engine').
:- use_module('../../logic/evaluate').

open_data :- cup_file(File), read_facts(File), engine_setup.

% cells(+Variables, +Formula, -Cells): Names-State for all that satisfies, Variables being Name-Sort.

cells([], F, States) :-
    denotation(F, [], prop, Bits),
    findall(S, ( between(0, 2, S), getbit(Bits, S) =:= 1 ), States).
cells([V-T], F, Cells) :-
    denotation(F, [V-T], con(T), Bits),
    findall(E-S,
            ( slot(E, 0, T, I), between(0, 2, S), Position is I*3 + S, getbit(Bits, Position) =:= 1 ),
            Cells).

:- begin_tests(evaluate, [setup(open_data)]).

test(projection, Cells == [t1-0, t2-2]) :-
    cells([v0-object], some(v1, object, on(v1, v0)), Cells).

test(difference, Cells == [p1-1, p1-2, p2-0, p2-1, p3-0, p3-1, p3-2]) :-
    cells([v0-pose], neg(some(v1, object, atpose(v1, v0))), Cells).

test(every_is_true_of_nothing, [true(Cells == [cup-0, cup-1, cup-2, t1-1, t1-2, t2-0, t2-1]), nondet]) :-
    cells([v0-object], every(v1, object, implies(on(v1, v0), holding(v0))), Cells).

test(four_variables, [true(States == [0, 2]), nondet]) :-
    cells([], some(v0, object, some(v1, pose, some(v2, object, some(v3, pose,
              conj(cfree(v0, v1, v2, v3), atpose(v0, v1)))))), States).

test(closure, Cells == [cup-0, cup-2]) :-
    cells([v0-object], some(v1, object, closure(v2, v3, object, on(v2, v3), v0, v1)), Cells).

test(disjunction_is_widened, Cells == [cup-0, cup-1, cup-2]) :-
    cells([v0-object], disj(holding(v0), some(v1, object, on(v0, v1))), Cells).

test(a_closure_over_other_variables, throws(error(notation_error(1, _), _))) :-
    cells([v0-object], some(v1, object, closure(v2, v3, object, conj(on(v2, v3), on(v2, v0)), v0, v1)), _).

:- end_tests(evaluate).
