:- module(features,
          [ start_features/0,
            collect_features/1,     % +Cost
            representative/7,       % ?Id, ?Cost, ?Kind, ?Item, -Pos, -Inc, -Dec
            transition_bit/2,       % ?Bit, -Transition
            feature_count/2         % ?What, -Number
          ]).
:- use_module(library(apply), [foldl/4]).
:- use_module(facts).
:- use_module(engine).
:- use_module(generate).
:- use_module(formula).
:- set_prolog_flag(optimise, true).

/** <module> From formulas to features

The value of a feature in every state is a list of _planes_: bit s of the I-th plane is binary digit I
of the value in state s. All that learning needs of a feature is qualitative: in which states it is
positive, and on which transitions it rises or falls. Features that agree in this and in their kind are
interchangeable; only the best of them, the _representative_, is kept. A Boolean feature and its
complement are interchangeable too. Features that are the same in all states and change on no transition
are dropped.
*/

:- dynamic
    best/9,         % Class, Cost, Size, Rank, Item, Kind, Pos, Inc, Dec
    representative/7,
    transition_bit/2,
    gather/4.       % Sources, Targets, Shift, Mask

%!  representative(?Id, ?Cost, ?Kind, ?Item, -Pos, -Inc, -Dec) is nondet.
%
%   Feature Id counts (Kind is `numeric`) or is (`boolean`) what formula Item says. It is positive in the states
%   Pos, and rises and falls on the transitions Inc and Dec (bit sets; see transition_bit/2).

%!  transition_bit(?Bit, -Transition) is nondet.
%
%   Transition is at Bit of Inc and Dec. Transitions between the same two states share a bit.

%!  start_features is det.
%
%   Forget all features, and prepare the comparison of values before and after each transition.

start_features :-
    retractall(best(_,_,_,_,_,_,_,_,_)),
    retractall(representative(_,_,_,_,_,_,_)),
    forall(member(Name, [values, behaviours]),
           ( trie_new(Trie), nb_setval(Name, Trie) )),
    forall(member(Name, [features, constant_features, distinct_values, behaviour_count]),
           nb_setval(Name, 0)),
    prepare_transitions.

% Values before and after a transition are brought together by multiplication: P*Sources has a copy of
% plane P for every distance D between the numbers of the two states of a transition, and in P*Targets
% the copies are shifted so that the bit of state S+D comes to lie where P*Sources has that of S. With
% distances in descending order the copies never overlap.

prepare_transitions :-
    retractall(transition_bit(_, _)),
    retractall(gather(_, _, _, _)),
    state_count(N),
    findall(D-(T-S), ( transition(T, S, S2), D is S2-S ), Pairs),
    findall(D, member(D-_, Pairs), Ds),
    sort(0, @>=, Ds, Distances0),
    sort(0, @>, Distances0, Distances),
    ( Distances = [Most|_] -> Shift is max(0, Most) ; Shift = 0 ),
    foldl(place_copy(N, Shift), Distances, 0-0-0, _-Sources-Targets),
    findall(Bit-T,
            ( nth0(I, Distances, D), member(D-(T-S), Pairs), Bit is N*I + S ),
            Bits),
    forall(member(Bit-T, Bits), assertz(transition_bit(Bit, T))),
    foldl([Bit-_, M0, M]>>(M is M0 \/ 1<<Bit), Bits, 0, Mask),
    assertz(gather(Sources, Targets, Shift, Mask)).

place_copy(N, Shift, D, I-Sources0-Targets0, I1-Sources-Targets) :-
    I1 is I + 1,
    Sources is Sources0 \/ 1<<(N*I),
    Targets is Targets0 \/ 1<<(N*I + Shift - D).

%!  collect_features(+Cost:nonneg) is det.
%
%   Turn the formulas of level Cost into features and number the new representatives.

collect_features(Cost) :-
    (   feature_item(Cost, Class, Item, Bits),
        offer_feature(Class, Cost, Item, Bits),
        fail
    ;   true
    ),
    number_representatives(Cost).

feature_item(Cost, Class, Item, Bits) :-
    bucket(Bucket, Class, Literals, Variables, _),
    ( Class = con(_) ; Class == prop ),
    Cost =:= max(Literals, Variables),
    item(Bucket, Item, _, _, Bits).

offer_feature(Class, Cost, Item, Bits) :-
    increment(features),
    count_bits(Class, Bits, Planes),
    meta(Item, Size, Rank, Bound, _, _),
    kind(Class, Bound, Kind),
    nb_getval(values, Values),
    (   trie_lookup(Values, Kind-Planes, behaviour(Behaviour, Pos, Inc, Dec))
    ->  true
    ;   increment(distinct_values),
        behaviour(Planes, Pos, Inc, Dec),
        (   constant(Pos, Inc, Dec)
        ->  increment(constant_features),
            Behaviour = none
        ;   canonical(Kind, Pos, Inc, Dec, Key),
            behaviour_number(Key, Behaviour)
        ),
        trie_insert(Values, Kind-Planes, behaviour(Behaviour, Pos, Inc, Dec))
    ),
    (   Behaviour == none
    ->  true
    ;   offer_best(Behaviour, Cost, Size, Rank, Item, Kind, Pos, Inc, Dec)
    ).

kind(prop, _, boolean) :- !.
kind(_, one, boolean) :- !.
kind(_, _, numeric).

constant(Pos, 0, 0) :-
    state_count(N),
    ( Pos =:= 0 ; Pos =:= (1<<N) - 1 ).

canonical(numeric, Pos, Inc, Dec, numeric(Pos, Inc, Dec)).
canonical(boolean, Pos, Inc, Dec, boolean(Key)) :-
    state_count(N),
    NotPos is \Pos /\ ((1<<N) - 1),
    (   Pos < NotPos
    ->  Key = key(Pos, Inc, Dec)
    ;   Key = key(NotPos, Dec, Inc)
    ).

behaviour_number(Key, Number) :-
    nb_getval(behaviours, Trie),
    (   trie_lookup(Trie, Key, Number)
    ->  true
    ;   nb_getval(behaviour_count, Number),
        increment(behaviour_count),
        trie_insert(Trie, Key, Number)
    ).

offer_best(Behaviour, Cost, Size, Rank, Item, Kind, Pos, Inc, Dec) :-
    (   best(Behaviour, Cost0, Size0, Rank0, Item0, _, _, _, _)
    ->  (   better(Cost-Size-Rank, Item, Cost0-Size0-Rank0, Item0)
        ->  retract(best(Behaviour, _, _, _, _, _, _, _, _)),
            assertz(best(Behaviour, Cost, Size, Rank, Item, Kind, Pos, Inc, Dec))
        ;   true
        )
    ;   assertz(best(Behaviour, Cost, Size, Rank, Item, Kind, Pos, Inc, Dec))
    ).

better(Key, Item, Key0, Item0) :-
    compare(Order, Key, Key0),
    (   Order == (<)
    ->  true
    ;   Order == (=),
        text_order(Item, Text),
        text_order(Item0, Text0),
        Text @< Text0
    ).

% What is counted comes before what is closed: Holding(x) rather than HandEmpty.

text_order(Item, Text) :-
    item_formula(Item, _, Sort, F),
    (   Sort == none
    ->  Text = closed(1, F)
    ;   Text = closed(0, F)
    ).

% behaviour(+Planes, -Pos, -Inc, -Dec): compare the numbers before and after, least significant digit first.

behaviour(Planes, Pos, Inc, Dec) :-
    gather(Sources, Targets, Shift, Mask),
    behaviour_(Planes, Sources, Targets, Shift, Mask, 0, 0, 0, Pos, Inc, Dec).

behaviour_([], _, _, _, _, Pos, Inc, Dec, Pos, Inc, Dec).
behaviour_([P|Ps], Sources, Targets, Shift, Mask, Pos0, Inc0, Dec0, Pos, Inc, Dec) :-
    Before is (P*Sources) /\ Mask,
    After is ((P*Targets) >> Shift) /\ Mask,
    Rise is After /\ \Before,
    Fall is Before /\ \After,
    Inc1 is Rise \/ (Inc0 /\ \Fall),
    Dec1 is Fall \/ (Dec0 /\ \Rise),
    Pos1 is Pos0 \/ P,
    behaviour_(Ps, Sources, Targets, Shift, Mask, Pos1, Inc1, Dec1, Pos, Inc, Dec).

% New representatives are numbered in the order of size and text. Those of lower levels keep their numbers.

number_representatives(Cost) :-
    findall(key(Size, Text)-f(Kind, Item, Pos, Inc, Dec),
            ( best(_, Cost, Size, _, Item, Kind, Pos, Inc, Dec),
              text_order(Item, Text) ),
            Pairs0),
    keysort(Pairs0, Pairs),
    aggregate_all(count, representative(_, _, _, _, _, _, _), N0),
    forall(nth1(I, Pairs, _-f(Kind, Item, Pos, Inc, Dec)),
           ( Id is N0 + I,
             assertz(representative(Id, Cost, Kind, Item, Pos, Inc, Dec)) )).

%!  feature_count(?What, -Number) is nondet.
%
%   Numbers since start_features/0: all features (`features`), those with different values somewhere
%   (`distinct_values`), of these the ones that never change (`constant_features`), and the
%   `representatives`.

feature_count(What, Number) :-
    member(What, [features, distinct_values, constant_features]),
    nb_getval(What, Number).
feature_count(representatives, Number) :-
    aggregate_all(count, representative(_, _, _, _, _, _, _), Number).

increment(What) :-
    nb_getval(What, N0),
    N is N0 + 1,
    nb_setval(What, N).
