:- module(features,
          [ start_features/0,
            collect_features/1,     % +Cost
            representative/7,       % ?Id, ?Cost, ?Kind, ?Item, -Pos, -Inc, -Dec
            transition_bit/2,       % ?Bit, -Transition
            find_feature/4,         % +Class, +Planes, -Id, -How
            feature_count/3         % ?Level, ?What, -Number
          ]).
:- use_module(library(aggregate), [aggregate_all/3]).
:- use_module(library(apply), [foldl/4]).
:- use_module(library(lists), [member/2, nth0/3, nth1/3]).
:- autoload(library(yall), [(>>)/5]).
:- use_module(engine, [count_bits/3]).
:- use_module(facts, [state_count/1, transition/3]).
:- use_module(formula, [item_formula/4]).
:- use_module(generate, [bucket/5, item/6, meta/6]).
:- set_prolog_flag(optimise, true).

/** <module> From formulas to features

    ?- pool_grammar(['logic/grammar.lp']), pool_open('tests/logic/cup.pl'), pool_level(0), pool_level(1),
       representative(1, Cost, Kind, Item, Positive, Rising, Falling), item_formula(Item, Variable, Sort, Formula).
    Cost = 1, Kind = boolean, Positive = 0b010, Variable = v0, Sort = object, Formula = holding(v0).

The value of a feature in every state is a list of _planes_: bit s of the I-th plane is binary digit I
of the value in state s. All that learning needs of a feature is qualitative: in which states it is
positive, and on which transitions it rises or falls. Features that agree in this and in their kind are
interchangeable; only the best of them, the _representative_, is kept. A Boolean feature and its
complement are interchangeable too. Features that are the same in all states and change on no transition
are dropped.
*/

:- dynamic
    best/4,         % Behaviour, Cost, Size-Rank, feature(Item, Kind, Pos, Inc, Dec)
    representative/7,
    transition_bit/2,
    gather/4,       % Sources, Targets, Shift, Mask
    feature_count/3.

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
    retractall(best(_,_,_,_)),
    retractall(representative(_,_,_,_,_,_,_)),
    forall(member(Name, [values, behaviours]),
           ( trie_new(Trie), nb_setval(Name, Trie) )),
    retractall(feature_count(_, _, _)),
    nb_setval(behaviour_count, 0),
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
    forall(counter(_, Key), nb_setval(Key, 0)),
    (   feature_item(Cost, Class, Item, Bits),
        offer_feature(Class, Cost, Item, Bits),
        fail
    ;   true
    ),
    number_representatives(Cost),
    forall(( counter(What, Key), nb_getval(Key, N), N > 0 ),
           assertz(feature_count(Cost, What, N))).

feature_item(Cost, Class, Item, Bits) :-
    bucket(Bucket, Class, Literals, Variables, _),
    ( Class = con(_) ; Class == prop ),
    Cost =:= max(Literals, Variables),
    item(Bucket, Item, _, _, _, Bits).

offer_feature(Class, Cost, Item, Bits) :-
    count_bits(Class, Bits, Planes),
    meta(Item, Size, Rank, Bound, _, _),
    kind(Class, Bound, Kind),
    nb_getval(values, Values),
    (   trie_lookup(Values, Kind-Planes, behaviour(Behaviour, Pos, Inc, Dec))
    ->  increment(count_same_values)
    ;   behaviour(Planes, Pos, Inc, Dec),
        (   constant(Pos, Inc, Dec)
        ->  Behaviour = none
        ;   canonical(Kind, Pos, Inc, Dec, Key),
            behaviour_number(Key, Behaviour)
        ),
        trie_insert(Values, Kind-Planes, behaviour(Behaviour, Pos, Inc, Dec))
    ),
    (   Behaviour == none
    ->  increment(count_constant)
    ;   offer_best(Behaviour, Cost, Size-Rank, feature(Item, Kind, Pos, Inc, Dec))
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
    ->  increment(count_same_behaviour)
    ;   nb_getval(behaviour_count, Number),
        increment(behaviour_count),
        increment(count_new),
        trie_insert(Trie, Key, Number)
    ).

offer_best(Behaviour, Cost, Key, Feature) :-
    (   best(Behaviour, Cost0, Key0, Feature0)
    ->  arg(1, Feature, Item),
        arg(1, Feature0, Item0),
        (   better(Cost-Key, Item, Cost0-Key0, Item0)
        ->  retract(best(Behaviour, _, _, _)),
            assertz(best(Behaviour, Cost, Key, Feature))
        ;   true
        )
    ;   assertz(best(Behaviour, Cost, Key, Feature))
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
    foldl(compare_digit(gather(Sources, Targets, Shift, Mask)), Planes, b(0, 0, 0), b(Pos, Inc, Dec)).

compare_digit(gather(Sources, Targets, Shift, Mask), P, b(Pos0, Inc0, Dec0), b(Pos, Inc, Dec)) :-
    Before is (P*Sources) /\ Mask,
    After is ((P*Targets) >> Shift) /\ Mask,
    Rise is After /\ \Before,
    Fall is Before /\ \After,
    Inc is Rise \/ (Inc0 /\ \Fall),
    Dec is Fall \/ (Dec0 /\ \Rise),
    Pos is Pos0 \/ P.

% New representatives are numbered in the order of size and text. Those of lower levels keep their numbers.

number_representatives(Cost) :-
    findall(key(Size, Text)-f(Kind, Item, Pos, Inc, Dec),
            ( best(_, Cost, Size-_, feature(Item, Kind, Pos, Inc, Dec)),
              text_order(Item, Text) ),
            Pairs0),
    keysort(Pairs0, Pairs),
    aggregate_all(count, representative(_, _, _, _, _, _, _), N0),
    forall(nth1(I, Pairs, _-f(Kind, Item, Pos, Inc, Dec)),
           ( Id is N0 + I,
             assertz(representative(Id, Cost, Kind, Item, Pos, Inc, Dec)) )).

%!  find_feature(+Class, +Planes, -Id, -How) is det.
%
%   How the feature of a formula of Class with these values is in the pool; see pool_formula/1.

find_feature(Class, Planes, Id, How) :-
    behaviour(Planes, Pos, Inc, Dec),
    (   constant(Pos, Inc, Dec)
    ->  Id = none,
        How = constant
    ;   findall(Cost/Rank-(Id1-How1),
                ( possible_kind(Class, Planes, Kind),
                  canonical(Kind, Pos, Inc, Dec, Key),
                  nb_getval(behaviours, Trie),
                  trie_lookup(Trie, Key, Behaviour),
                  found(Behaviour, Planes, Id1, How1),
                  once(representative(Id1, Cost, _, _, _, _, _)),
                  nth1(Rank, [same_values, complement, same_behaviour], How1) ),
                Found0),
        keysort(Found0, [_-(Id0-How0)|_])
    ->  Id = Id0,
        How = How0
    ;   Id = none,
        How = absent
    ).

% A count that never exceeds one is compared with Boolean features, too.
possible_kind(Class, _, numeric) :- Class \== prop.
possible_kind(_, [_], boolean).

found(Behaviour, Planes, Id, How) :-
    once(best(Behaviour, _, _, feature(Item, _, _, _, _))),
    once(representative(Id, _, _, Item, Pos, _, _)),
    once(item(Bucket, Item, _, _, _, Bits)),
    bucket(Bucket, Class, _, _, _),
    count_bits(Class, Bits, Planes1),
    foldl([P, U0, U]>>(U is U0 \/ P), Planes, 0, Here),
    (   Planes1 == Planes
    ->  How = same_values
    ;   Pos =\= Here
    ->  How = complement
    ;   How = same_behaviour
    ).

%!  feature_count(?Level, ?What, -Number) is nondet.
%
%   What became of the formulas of a Level as features: `constant` (the same value in all states), `same_values`
%   as a feature before, `same_behaviour` (other values, but positive, rising and falling alike), or `new`.

counter(constant, count_constant).
counter(same_values, count_same_values).
counter(same_behaviour, count_same_behaviour).
counter(new, count_new).

increment(What) :-
    nb_getval(What, N0),
    N is N0 + 1,
    nb_setval(What, N).
