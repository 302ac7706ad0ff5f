:- use_module(library(plunit)).
:- use_module(cup_pool).
:- use_module('../../logic/features').
:- use_module('../../logic/formula').

:- begin_tests(features, [setup(open_cup)]).

test(holding_is_boolean, [true(F == feature(boolean, 0b010)), nondet]) :-
    representative(_, 1, Kind, Item, Pos, _, _),
    item_formula(Item, v0, object, holding(v0)),
    F = feature(Kind, Pos).

test(changes, [true(Changes == [0,2]-[1]), nondet]) :-
    representative(_, _, numeric, _, 0b101, Inc, Dec),
    transitions(Dec, Down),
    transitions(Inc, Up),
    Changes = Down-Up.

test(projection_is_printed_with_its_quantifier, [true, nondet]) :-
    representative(_, _, _, Item, _, _, _),
    item_formula(Item, v0, pose, some(v1, object, atpose(v1, v0))).

test(numbered_from_one, Ids == Expected) :-
    findall(Id, representative(Id, _, _, _, _, _, _), Ids),
    length(Ids, N),
    numlist(1, N, Expected).

transitions(Bits, Ts) :-
    findall(T, ( transition_bit(B, T), Bits /\ (1<<B) =\= 0 ), Ts0),
    sort(Ts0, Ts).

:- end_tests(features).
