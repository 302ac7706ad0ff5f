:- module(engine,
          [ engine_setup/0,
            classes/1,              % -Classes
            mask/2,                 % +Class, -Mask
            shape/3,                % +Class, -Outer, -Width
            assemble/3,             % +Blocks, +Width, -Bits
            warm/2,                 % +Classes, +Bits
            wider/3,                % +Class, +C, -D
            single/2,               % +Class, +Bits
            count_bits/3,           % +Class, +Bits, -Planes
                                    % what a grammar may call:
            meet/3,                 % +A, +B, -D
            join/3,                 % +A, +B, -D
            complement/3,           % +Class, +A, -D
            implies/4,              % +Class, +A, +B, -D
            some/3,                 % +Class, +A, -D
            restrict/4,             % +Class, +C, +R, -D
            exclude/4,              % +Class, +C, +R, -D
            given/3,                % +Class, +P, -D
            diagonal/3,             % +Class, +R, -D
            compose/5,              % +ClassA, +ClassB, +A, +B, -D
            closure/3,              % +Class, +R, -D
            primitive/1             % ?Head
          ]).
:- use_module(library(lists), [member/2, reverse/2]).
:- use_module(facts, [entity_count/2, entity_count/3, problem_states/2, state_count/1]).
:- set_prolog_flag(optimise, true).

/** <module> Denotations as bit vectors

    ?- read_facts('tests/logic/cup.pl'), engine_setup, mask(con(object), Mask), complement(con(object), 5, Bits).
    Mask = 0b111_111_111, Bits = 0b111_111_010.

A formula denotes the set of variable assignments and states that satisfy it. The set is one unbounded
integer. Its bits are laid out like an array whose last index, the state, varies fastest:

    prop            [State]
    con(X)          [X][State]                one free variable of sort X
    role(Y,X)       [Y][X][State]             two; Y is the one a quantifier binds
    triple(Z,Y,X)   [Z][Y][X][State]          three, for predicates that stay ternary

so that one arithmetic operation works on all entities of all states of all problems at once, and
"there is a Y" is a fold of the outermost dimension. Entities that a problem does not have are masked
out: a denotation never has a bit outside mask/2 of its class.

Shift counts above 2^31 are silently wrong in this Prolog; roomy/1 refuses such shapes.
*/

:- dynamic shape_/3, mask_key/2, spread_key/4.

%!  engine_setup is det.
%
%   Lay out the classes for the data at hand (see facts.pl).

engine_setup :-
    retractall(shape_(_, _, _)),
    retractall(mask_key(_, _)),
    retractall(spread_key(_, _, _, _)),
    nb_setval(lifted, none),
    state_count(S),
    Ones is (1<<S) - 1,
    add_class(prop, 1, S, Ones),
    findall(T-N, ( entity_count(T, N), N > 0 ), Sorts),
    forall(member(T-N, Sorts),
           ( con_mask(T, S, Mask),
             add_class(con(T), N, S, Mask) )),
    forall(( member(Y-N, Sorts), member(X-M, Sorts), roomy(N*M*S) ),
           ( W is M*S,
             add_class(role(Y,X), N, W, pending) )).

roomy(Bits) :-
    Bits < 1<<28.

add_class(Class, Outer, Width, Mask) :-
    assertz(shape_(Class, Outer, Width)),
    term_to_atom(mask(Class), Key),
    nb_setval(Key, Mask),
    assertz(mask_key(Class, Key)).

con_mask(T, S, Mask) :-
    findall(I-States,
            ( entity_count(P, T, N), problem_states(P, States), Top is N-1, between(0, Top, I) ),
            Blocks),
    assemble(Blocks, S, Mask).

%!  classes(-Classes:list) is det.
%
%   The classes that formulas over the data can have.

classes(Classes) :-
    findall(Class, shape_(Class, _, _), Classes).

%!  shape(+Class, -Outer, -Width) is semidet.
%
%   Class has Outer entities in its outermost dimension, each with Width bits. False where a class has
%   no entities or would not fit.

shape(Class, Outer, Width) :-
    shape_(Class, Outer, Width),
    !.
shape(imp(T), Outer, Width) :-
    shape_(con(T), Outer, Width).
shape(triple(Z,Y,X), Outer, Width) :-
    shape_(con(Z), Outer, S),
    shape_(role(Y,X), N, W),
    Width is N*W,
    S > 0,
    roomy(Outer*Width).

%!  mask(+Class, -Mask) is semidet.
%
%   Mask has a bit for every assignment of existing entities.

mask(Class, Mask) :-
    mask_key(Class, Key),
    !,
    nb_getval(Key, Mask0),
    (   Mask0 == pending
    ->  make_mask(Class, Mask),
        nb_setval(Key, Mask)
    ;   Mask = Mask0
    ).
mask(imp(T), Mask) :-
    mask(con(T), Mask).
mask(triple(Z,Y,X), Mask) :-
    make_mask(triple(Z,Y,X), Mask).

make_mask(role(Y,X), Mask) :-
    product_mask(role(Y,X), Y, con(X), Mask).
make_mask(triple(Z,Y,X), Mask) :-
    product_mask(triple(Z,Y,X), Z, role(Y,X), Mask).

product_mask(Class, Outer, Inner, Mask) :-
    mask(con(Outer), M1),
    mask(Inner, M2),
    lift(Class, M1, L),
    wider(Class, M2, R),
    Mask is L /\ R.

%!  assemble(+Blocks, +Width, -Bits) is det.
%
%   Put blocks Index-Bits of Width bits each into one vector; blocks with equal Index are united.
%   Neighbours are merged pairwise, which keeps the work near linear in the size of the result.

assemble(Blocks0, Width, Bits) :-
    keysort(Blocks0, Blocks),
    assemble_(Blocks, Width, Bits).

assemble_([], _, 0) :- !.
assemble_([I-B], Width, Bits) :-
    !,
    Bits is B << (I*Width).
assemble_(Blocks, Width, Bits) :-
    merge_neighbours(Blocks, Width, Merged),
    assemble_(Merged, Width, Bits).

merge_neighbours([I-A, J-B|Blocks], Width, [I-D|Merged]) :-
    !,
    D is A \/ (B << ((J-I)*Width)),
    merge_neighbours(Blocks, Width, Merged).
merge_neighbours(Blocks, _, Blocks).

%!  primitive(?Head) is nondet.
%
%   Head may be called in the body of a grammar clause.

primitive(meet(_, _, _)).
primitive(join(_, _, _)).
primitive(complement(_, _, _)).
primitive(implies(_, _, _, _)).
primitive(some(_, _, _)).
primitive(restrict(_, _, _, _)).
primitive(exclude(_, _, _, _)).
primitive(given(_, _, _)).
primitive(diagonal(_, _, _)).
primitive(compose(_, _, _, _, _)).
primitive(closure(_, _, _)).

%!  meet(+A, +B, -D) is det.
%
%   D is A and B.

meet(A, B, D) :-
    D is A /\ B.

%!  join(+A, +B, -D) is det.
%
%   D is A or B.

join(A, B, D) :-
    D is A \/ B.

%!  complement(+Class, +A, -D) is det.
%
%   D is "not A" of Class.

complement(Class, A, D) :-
    mask(Class, M),
    D is M /\ \A.

%!  implies(+Class, +A, +B, -D) is det.
%
%   D is "if A then B" of Class.

implies(Class, A, B, D) :-
    mask(Class, M),
    D is M /\ (\A \/ B).

%!  some(+Class, +A, -D) is det.
%
%   D is "there is a value of the outermost variable of Class for which A".

some(Class, A, D) :-
    shape(Class, N, W),
    fold(N, W, A, D).

fold(1, _, D, D) :- !.
fold(N, W, A, D) :-
    H is (N+1) // 2,
    Half is H*W,
    B is A >> Half,
    (   B =:= 0
    ->  fold(H, W, A, D)
    ;   C is (A /\ ((1<<Half) - 1)) \/ B,
        fold(H, W, C, D)
    ).

%!  restrict(+Class, +C, +R, -D) is det.
%
%   D is R and C, where C speaks of the outermost variable of Class only.

restrict(Class, C, R, D) :-
    lifted(Class, C, L),
    D is R /\ L.

%!  exclude(+Class, +C, +R, -D) is det.
%
%   D is R and not C, where C speaks of the outermost variable of Class only.

exclude(Class, C, R, D) :-
    lifted(Class, C, L),
    D is R /\ \L.

%!  given(+Class, +P, -D) is det.
%
%   D of Class, which is a con(X), says P of every X; P speaks of the state only.

given(Class, P, D) :-
    wider(Class, P, W),
    mask(Class, M),
    D is W /\ M.

%!  diagonal(+Class, +R, -D) is det.
%
%   D(x) is R(x,x). Class is role(X,X).

diagonal(role(T,T), R, D) :-
    mask(con(T), M),
    lift(role(T,T), M, L),
    diagonal_mask(T, Same),
    P is R /\ L /\ Same,
    some(role(T,T), P, D).

diagonal_mask(T, Mask) :-
    shape(role(T,T), N, W),
    state_count(S),
    Ones is (1<<S) - 1,
    Last is N-1,
    findall(I-Block, ( between(0, Last, I), Block is Ones << (I*S) ), Blocks),
    assemble(Blocks, W, Mask).

%!  warm(+Classes, +C) is det.
%
%   Lift C once before it is combined with many operands: an optimisation for loops whose first operand
%   is a con(Y) and whose second one binds Y. Undone on backtracking.

warm([con(Y), Operand], C) :-
    relation(Operand, Y, Class),
    !,
    lift(Class, C, L),
    b_setval(lifted, lifted(Class, C, L)).
warm(_, _).

relation(role(Y,X), Y, role(Y,X)).
relation(own(role(Y,X)), Y, role(Y,X)).
relation(test(role(Y,X)), Y, role(Y,X)).
relation(triple(Z,Y,X), Z, triple(Z,Y,X)).

lifted(Class, C, L) :-
    b_getval(lifted, lifted(Class0, C0, L0)),
    Class0 == Class,
    C0 =:= C,
    !,
    L = L0.
lifted(Class, C, L) :-
    lift(Class, C, L).

% lift(+Class, +C, -L): C speaks of the outermost variable; L says the same for every value of the others.

lift(Class, C, L) :-
    shape(Class, N, W),
    state_count(S),
    spread_steps(N, S, W, Steps),
    spread(Steps, C, Spread),
    Copies is W // S,
    replicate(Copies, S, Spread, L).

% Move N adjacent blocks of S bits apart until each starts W bits after the one before, in log2(N) steps:
% first the upper half moves, then the upper half of each half, and so on.

spread([], D, D).
spread([Shift-Mask|Steps], C, D) :-
    C1 is (C \/ (C << Shift)) /\ Mask,
    spread(Steps, C1, D).

spread_steps(N, S, W, Steps) :-
    spread_key(N, S, W, Key),
    !,
    nb_getval(Key, Steps).
spread_steps(N, S, W, Steps) :-
    (   N =:= 1 ; W =:= S   ),
    !,
    Steps = [].
spread_steps(N, S, W, Steps) :-
    Top is msb(N-1),
    make_spread_steps(Top, N, S, W, Steps),
    format(atom(Key), 'spread ~d ~d ~d', [N, S, W]),
    nb_setval(Key, Steps),
    assertz(spread_key(N, S, W, Key)).

make_spread_steps(-1, _, _, _, []) :- !.
make_spread_steps(K, N, S, W, [Shift-Mask|Steps]) :-
    Shift is (1<<K) * (W-S),
    Ones is (1<<S) - 1,
    Stretch is W//S - 1,
    Last is N-1,
    findall(J-Ones,
            ( between(0, Last, I),
              J is I + ((I>>K)<<K)*Stretch ),
            Blocks),
    assemble(Blocks, S, Mask),
    K1 is K-1,
    make_spread_steps(K1, N, S, W, Steps).

%!  wider(+Class, +C, -D) is det.
%
%   C speaks of all variables of Class but the outermost; D says the same for every value of that one.

wider(Class, C, D) :-
    shape(Class, N, W),
    replicate(N, W, C, D).

% replicate(+N, +W, +A, -D): N copies of A, each W bits after the one before.

replicate(1, _, A, A) :- !.
replicate(N, W, A, D) :-
    H is N // 2,
    replicate(H, W, A, B),
    C is B \/ (B << (H*W)),
    (   N =:= 2*H
    ->  D = C
    ;   D is C \/ (A << ((N-1)*W))
    ).

%!  compose(+ClassA, +ClassB, +A, +B, -D) is det.
%
%   D(y,x) is "there is an m with A(y,m) and B(m,x)": the image of every row of A under B. ClassA is
%   role(Y,M), ClassB is role(M,X).

compose(role(Y,M), role(M,X), A, B, D) :-
    shape(role(Y,M), N, W),
    shape(role(Y,X), N, W2),
    Row is (1<<W) - 1,
    Last is N-1,
    findall(I-Image,
            ( between(0, Last, I),
              C is (A >> (I*W)) /\ Row,
              C =\= 0,
              restrict(role(M,X), C, B, P),
              some(role(M,X), P, Image) ),
            Rows),
    assemble(Rows, W2, D).

%!  closure(+Class, +R, -D) is det.
%
%   D is the transitive closure of R. Class is role(T,T).

closure(role(T,T), R, D) :-
    compose(role(T,T), role(T,T), R, R, R2),
    D1 is R \/ R2,
    (   D1 =:= R
    ->  D = R
    ;   closure(role(T,T), D1, D)
    ).

%!  count_bits(+Class, +Bits, -Planes:list) is det.
%
%   Count, over the outermost variable of Class: plane I holds binary digit I of the counts, for all values
%   of the other variables and all states at once. The upper half of the blocks is added to the lower half,
%   digit by digit, until one block remains. The last plane is not 0.

count_bits(Class, Bits, Planes) :-
    shape(Class, N, W),
    count_blocks(N, W, [Bits], Planes).

count_blocks(1, _, Planes0, Planes) :-
    !,
    strip_zeros(Planes0, Planes).
count_blocks(N, W, Planes0, Planes) :-
    H is (N+1) // 2,
    Half is H*W,
    Low is (1<<Half) - 1,
    add_halves(Planes0, Half, Low, 0, Planes1),
    count_blocks(H, W, Planes1, Planes).

add_halves([], _, _, Carry, [Carry]).
add_halves([P|Ps], Half, Low, Carry0, [D|Ds]) :-
    A is P /\ Low,
    B is P >> Half,
    X is A xor B,
    D is X xor Carry0,
    Carry is (A /\ B) \/ (X /\ Carry0),
    add_halves(Ps, Half, Low, Carry, Ds).

strip_zeros(Planes0, Planes) :-
    reverse(Planes0, Reversed0),
    strip_leading(Reversed0, Reversed),
    reverse(Reversed, Planes).

strip_leading([0|Ps], Planes) :- !, strip_leading(Ps, Planes).
strip_leading(Planes, Planes).

%!  single(+Class, +Bits) is semidet.
%
%   At most one value of the outermost variable goes with any values of the others.

single(Class, Bits) :-
    count_bits(Class, Bits, Planes),
    length(Planes, N),
    N =< 1.
