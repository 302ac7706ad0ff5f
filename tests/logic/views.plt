:- use_module(library(plunit)).
:- use_module(cup_pool).
:- use_module('../../logic/views').

views(Name, Views) :-
    findall(Kind-Positions, view(Kind, _, Name, Positions, _, _), Views).

:- begin_tests(views, [setup(open_cup)]).

test(a_pose_determines_its_object, Views == [own-[2,1], pred-[2]]) :-
    views(atpose, Views0),
    sort(Views0, Views).

test(a_collision_test_relates_two_poses, Views == [test-[2,4], test-[4,2]]) :-
    views(cfree, Views0),
    maplist([_-P, test-P]>>true, Views0, Views).

test(a_stream_ties_its_output_to_every_input, Ties == [[1,2], [2,1], [2,3], [3,2]]) :-
    views(pose, Views),
    findall(P, ( member(_-P, Views), length(P, 2) ), Ties0),
    sort(Ties0, Ties).

test(a_product_is_replaced_by_its_projections, Views == [pred-[1], pred-[2]]) :-
    views(near, Views).

test(unary, Views == [pred-[1]]) :-
    views(holding, Views).

:- end_tests(views).
