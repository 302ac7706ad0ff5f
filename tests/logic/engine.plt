:- use_module(library(plunit)).
:- use_module('../../logic/facts').
:- use_module('../../logic/engine').

% Two problems, three states: objects a, b, c (states 0 and 1) and a, b (state 2); places p, q and p.

data([ sort(object), sort(place), predicate(at, [object,place]),
       problem(0), entity(0, object, a), entity(0, object, b), entity(0, object, c),
       entity(0, place, p), entity(0, place, q), state(0, 0), state(1, 0),
       problem(1), entity(1, object, a), entity(1, object, b), entity(1, place, p), state(2, 1) ]).

open_data :-
    data(Facts),
    tmp_file_stream(File, Out, [encoding(utf8)]),
    forall(member(Fact, Facts), format(Out, "~q.~n", [Fact])),
    close(Out),
    read_facts(File),
    engine_setup.

% bits(+Class, +Cells, -Bits): Cells are lists of indices, the state last.
bits(Class, Cells, Bits) :-
    foldl([Cell, B0, B]>>( position(Class, Cell, I), B is B0 \/ 1<<I ), Cells, 0, Bits).

position(con(_), [X,S], I) :- I is X*3 + S.
position(role(_,X), [Y,Z,S], I) :- entity_count(X, N), I is (Y*N + Z)*3 + S.

:- begin_tests(engine, [setup(open_data)]).

test(con_mask, M == B) :-
    mask(con(object), M),
    bits(con(object), [[0,0],[0,1],[0,2],[1,0],[1,1],[1,2],[2,0],[2,1]], B).

test(role_mask_has_pairs_of_one_problem, M == B) :-
    mask(role(place,object), M),
    bits(role(place,object),
         [[0,0,0],[0,0,1],[0,0,2],[0,1,0],[0,1,1],[0,1,2],[0,2,0],[0,2,1],
          [1,0,0],[1,0,1],[1,1,0],[1,1,1],[1,2,0],[1,2,1]], B).

test(some_binds_the_outer_variable, D == B) :-
    bits(role(place,object), [[1,2,0],[0,2,0],[1,0,1],[0,1,2]], R),
    some(role(place,object), R, D),
    bits(con(object), [[2,0],[0,1],[1,2]], B).

test(restrict, D == B) :-
    bits(role(object,place), [[0,0,0],[0,1,0],[1,0,1],[2,1,1]], R),
    bits(con(object), [[0,0],[2,1]], C),
    restrict(role(object,place), C, R, D),
    bits(role(object,place), [[0,0,0],[0,1,0],[2,1,1]], B).

test(exclude, D == B) :-
    bits(role(object,place), [[0,0,0],[0,1,0],[1,0,1],[2,1,1]], R),
    bits(con(object), [[0,0],[2,1]], C),
    exclude(role(object,place), C, R, D),
    bits(role(object,place), [[1,0,1]], B).

test(warm_changes_no_result, D == E) :-
    bits(role(object,place), [[0,0,0],[0,1,0],[1,0,1],[2,1,1]], R),
    bits(con(object), [[0,0],[2,1]], C),
    restrict(role(object,place), C, R, D),
    warm([con(object), role(object,place)], C),
    restrict(role(object,place), C, R, E).

test(complement_stays_inside_the_mask, D == B) :-
    bits(con(place), [[0,0],[0,2]], C),
    complement(con(place), C, D),
    bits(con(place), [[0,1],[1,0],[1,1]], B).

test(implies, D == B) :-
    bits(con(place), [[0,0],[0,1],[1,0]], P),
    bits(con(place), [[0,1]], Q),
    implies(con(place), P, Q, D),
    bits(con(place), [[0,1],[1,1],[0,2]], B).

test(compose, D == B) :-
    bits(role(object,place), [[0,1,0],[1,0,1]], R),
    bits(role(place,object), [[1,2,0],[0,2,1],[0,1,0]], S),
    compose(role(object,place), role(place,object), R, S, D),
    bits(role(object,object), [[0,2,0],[1,2,1]], B).

test(closure, D == B) :-
    bits(role(object,object), [[0,1,0],[1,2,0],[1,0,2]], R),
    closure(role(object,object), R, D),
    bits(role(object,object), [[0,1,0],[1,2,0],[0,2,0],[1,0,2]], B).

test(count_in_binary, Planes == [0b011, 0b001]) :-
    bits(con(object), [[0,0],[1,0],[2,0],[1,1]], C),
    count_bits(con(object), C, Planes).

test(single) :-
    bits(role(place,object), [[0,0,0],[1,1,0],[1,0,1]], R),
    single(role(place,object), R).

test(not_single, fail) :-
    bits(role(place,object), [[0,0,0],[1,0,0]], R),
    single(role(place,object), R).

test(assemble_unites_equal_blocks, D == 0b101_000_110) :-
    assemble([2-0b101, 0-0b010, 0-0b100], 3, D).

test(prop_is_a_set_of_states, M == 0b111) :-
    mask(prop, M).

:- end_tests(engine).
