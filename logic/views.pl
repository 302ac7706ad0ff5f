:- module(views,
          [ view/6,                 % -Kind, -Class, -Predicate, -Positions, -Bound, -Bits
            class/2                 % ?Sorts, ?Class
          ]).
:- use_module(library(apply), [maplist/3]).
:- use_module(library(lists), [member/2, nth1/3, permutation/2, subtract/3]).
:- autoload(library(yall), [(>>)/4]).
:- use_module(engine, [assemble/3, mask/2, restrict/4, shape/3, single/2, wider/3]).
:- use_module(facts, [at_most_one/1, entity_count/2, fluent/1, owner/3, predicate/2, slot/4, state_count/1, tuple/4]).

/** <module> Predicates seen through the entities that matter

    ?- read_facts('tests/logic/cup.pl'), engine_setup, view(Kind, Class, holding, Positions, Bound, Bits).
    Kind = pred, Class = con(object), Positions = [1], Bound = one, Bits = 0b010.

A sampled entity determines the inputs of the stream that made it: a pose knows its object and its
support. Where the data confirm this, AtPose(o,p) says no more than "p is occupied" and a four-place
collision test relates two poses. Such a predicate is used through a _view_: its projection onto some
argument positions, the others existentially quantified. A view is therefore always exactly the formula
it prints as, whether or not the data collapse; what the check decides is only which views lose nothing.

Under negation the projection is the guarded reading: not CFree(p,q) says that the poses p and q _of
their own objects_ collide.

Every predicate with data has the view of its keys, the arguments that no other argument determines. From
three keys on it has those of all pairs of them, too, and if there are more, of all triples instead of the
whole. On top of that, an owning predicate like Pose(o,p,s) has a view of its entity p with each of the
arguments that p determines, and a fluent like AtPose(o,p) has the view that finds p from o. What kind of
formula a view is depends on its data:

  - `own` if it relates two variables and in every state at most one first goes with a second ("its
    support"): then "every" would only add "or none";
  - `link` for the converse of an own view of a sampled entity ("one of its poses"). Links are never
    negated: "x is not a pose of o" holds of nearly all pairs;
  - `test` for another static relation of two sampled entities, such as a collision test;
  - `pred` for all else.

A static relation that is merely the product of its two projections, like a Stackable(o,s) that holds of all
movable o and all supports s, is replaced by the projections.
*/

%!  view(-Kind, -Class, -Predicate, -Positions, -Bound, -Bits) is nondet.
%
%   Predicate can be used as a formula of Class whose variables are its arguments at Positions, and Bits is
%   its denotation (`none` if too large for a bit vector). Bound is `one` if at most one tuple is true in a
%   state, `function` if the first variable determines the second, and `many` otherwise.

view(Kind, Class, Name, Positions, Bound, Bits) :-
    findall(Name0-Sorts0, predicate(Name0, Sorts0), Predicates0),
    msort(Predicates0, Predicates),
    prepare_images,
    member(Name-Sorts, Predicates),
    once(tuple(Name, _, _, _)),
    dependencies(Name, Sorts, Dependencies),
    keys(Sorts, Dependencies, Keys),
    view_positions(Kind0, Name, Sorts, Keys, Dependencies, Positions),
    maplist([I, T]>>nth1(I, Sorts, T), Positions, Variables),
    class(Variables, Class),
    (   shape(Class, _, _)
    ->  view_bits(Class, Name, Positions, Bits)
    ;   Bits = none
    ),
    kind(Kind0, Name, Class, Bits, Kind),
    bound(Name, Positions, Dependencies, Bound).

kind(_, _, role(Y,X), Bits, own) :-
    integer(Bits),
    single(role(Y,X), Bits),
    !.
kind(key, Name, role(Y,X), _, test) :-
    \+ fluent(Name),
    once(owner(_, Y, _)),
    once(owner(_, X, _)),
    !.
kind(key, _, _, _, pred).
kind(link, _, _, _, link).

%!  class(?Sorts:list, ?Class) is semidet.
%
%   A formula whose free variables have these Sorts, the outermost first, is of Class.

class([], prop).
class([X], con(X)).
class([Y,X], role(Y,X)).
class([Z,Y,X], triple(Z,Y,X)).

bound(Name, _, _, one) :-
    at_most_one(Name),
    !.
bound(_, [I,K], Dependencies, function) :-
    memberchk(I-K, Dependencies),
    !.
bound(_, _, _, many).

view_positions(key, Name, Sorts, Keys, _, Positions) :-
    length(Keys, N),
    (   Keys = [I,K],
        \+ fluent(Name),
        product(Name, Sorts, I, K)
    ->  member(Positions, [[I], [K]])
    ;   key_positions(N, Keys, Positions)
    ).
view_positions(link, Name, Sorts, _, Dependencies, Positions) :-
    member(I-K, Dependencies),
    nth1(I, Sorts, T),
    (   owner(Name, T, I)
    ->  permutation([I,K], Positions)
    ;   length(Sorts, 2),
        fluent(Name),
        nth1(K, Sorts, U),
        view_bits(role(T,U), Name, [I,K], Bits),
        single(role(T,U), Bits),
        Positions = [I,K]
    ).

key_positions(N, Keys, Positions) :-
    N =< 3,
    permutation(Keys, Positions).
key_positions(N, Keys, [I,K]) :-
    N >= 3,
    member(I, Keys),
    member(K, Keys),
    I =\= K.
key_positions(N, Keys, [I,J,K]) :-
    N >= 4,
    member(I, Keys),
    member(J, Keys),
    J =\= I,
    member(K, Keys),
    K =\= I,
    K =\= J.

% product(+Name, +Sorts, +I, +K): the relation between arguments I and K is all pairs of some set with another.

product(Name, Sorts, I, K) :-
    nth1(I, Sorts, T),
    nth1(K, Sorts, U),
    shape(role(T,U), _, _),
    view_bits(role(T,U), Name, [I,K], Bits),
    view_bits(con(T), Name, [I], First),
    view_bits(con(U), Name, [K], Second),
    mask(role(T,U), Mask),
    restrict(role(T,U), First, Mask, P),
    wider(role(T,U), Second, W),
    Bits =:= P /\ W.

% dependencies(+Name, +Sorts, -Pairs): I-K where argument I determines argument K in all the data.

dependencies(Name, Sorts, Dependencies) :-
    findall(I-K,
            ( nth1(I, Sorts, T),
              once(owner(_, T, _)),
              nth1(K, Sorts, U),
              I =\= K,
              once(determines(Name, I, T, K, U)) ),
            Dependencies).

determines(Name, I, T, K, U) :-
    owner(Owner, T, J),
    predicate(Owner, OwnerSorts),
    nth1(M, OwnerSorts, U),
    M =\= J,
    \+ ambiguous(Owner, M, _, _),
    \+ ( tuple(Name, P, _, Arguments),
         nth1(I, Arguments, E),
         nth1(K, Arguments, V),
         \+ image(Owner, M, P, E, V) ).

% keys(+Sorts, +Dependencies, -Positions): what remains when determined arguments are left out one by one.

keys(Sorts, Dependencies, Keys) :-
    findall(I, nth1(I, Sorts, _), All),
    leave_out(All, All, Dependencies, Keys).

leave_out([], Keys, _, Keys).
leave_out([K|Ks], Keys0, Dependencies, Keys) :-
    (   member(I-K, Dependencies),
        memberchk(I, Keys0)
    ->  subtract(Keys0, [K], Keys1)
    ;   Keys1 = Keys0
    ),
    leave_out(Ks, Keys1, Dependencies, Keys).

:- dynamic image/5, ambiguous/4.

% image(Owner, M, P, E, V): the owner's tuple of entity E has V as its M-th argument.

prepare_images :-
    retractall(image(_, _, _, _, _)),
    retractall(ambiguous(_, _, _, _)),
    forall(( owner(Owner, _, J),
             tuple(Owner, P, _, Arguments),
             nth1(J, Arguments, E),
             nth1(M, Arguments, V),
             M =\= J ),
           add_image(Owner, M, P, E, V)).

add_image(Owner, M, P, E, V) :-
    image(Owner, M, P, E, V0),
    !,
    (   V0 == V
    ->  true
    ;   assertz(ambiguous(Owner, M, P, E))
    ).
add_image(Owner, M, P, E, V) :-
    assertz(image(Owner, M, P, E, V)).

% view_bits(+Class, +Predicate, +Positions, -Bits): the denotation of Predicate projected onto Positions.

view_bits(Class, Name, Positions, Bits) :-
    Class =.. [_|Sorts],
    findall(Index-States,
            ( tuple(Name, P, States, Arguments),
              index(Positions, Sorts, P, Arguments, 0, Index) ),
            Blocks),
    state_count(S),
    assemble(Blocks, S, Bits).

index([], [], _, _, Index, Index).
index([I|Is], [T|Ts], P, Arguments, Index0, Index) :-
    arg_(I, Arguments, E),
    slot(E, P, T, Slot),
    entity_count(T, N),
    Index1 is Index0*N + Slot,
    index(Is, Ts, P, Arguments, Index1, Index).

arg_(I, Arguments, E) :-
    nth1(I, Arguments, E),
    !.
