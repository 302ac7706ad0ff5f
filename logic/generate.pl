:- module(generate,
          [ start_generating/0,
            generate_level/1,       % +Cost
            item/5,                 % ?Bucket, ?Id, ?Last, ?Implications, ?Bits
            bucket/5,               % ?Bucket, ?Class, ?Literals, ?Variables, ?Made
            meta/6,                 % ?Id, ?Size, ?Rank, ?Bound, ?Rule, ?Operands
            count/2                 % ?What, -Number
          ]).
:- use_module(library(lists), [max_list/2, sum_list/2, nth1/3]).
:- use_module(library(apply), [maplist/3]).
:- use_module(engine).
:- use_module(facts, [predicate/2]).
:- use_module(views).
:- use_module(rules).
:- use_module(formula, [formula/3]).
:- set_prolog_flag(optimise, true).

/** <module> Formulas, level by level

Level K makes all formulas of cost K from cheaper ones (and from formulas of the same cost with fewer
literals). A formula is kept only if no earlier one of the same class has the same denotation on the
data, and if it is neither always true nor always false: everything built from a dropped formula equals
something built from the kept one at no greater cost.

Formulas live in the database, not on the stacks, and the loops are failure-driven, so that nothing is
left for the garbage collector:

    item(Bucket, Id, Last, Implications, Bits)
    bucket(Bucket, Class, Literals, Variables, Made)    what the items of a bucket have in common
    meta(Id, Size, Rank, Bound, Rule, Operands)         what only the formulas kept need

A set of operands of a commutative rule is built once, in ascending order of Id: Made is that rule's
name (and - for all other items), Last the Id of the last operand.
*/

:- dynamic
    item/5, bucket/5, meta/6,
    plan/7,                     % ResultKind, Operands, Result, Cost, Shared, Commutative, Rules
    trie_key/2.                 % Class, Key

%!  bucket(?Bucket, ?Class, ?Literals, ?Variables, ?Made) is nondet.
%
%   The items of Bucket are formulas of Class with these numbers of literals (rule costs, to be precise) and
%   variables.

%!  item(?Bucket, ?Id, ?Last, ?Implications, ?Bits) is nondet.
%
%   Formula Id has the denotation Bits.

%!  meta(?Id, ?Size, ?Rank, ?Bound, ?Rule, ?Operands) is nondet.
%
%   Formula Id is the result of Rule (or a view) for the items Operands. Size counts its rules and the arguments
%   that views hide behind a quantifier, Rank adds up their places in the grammar; Bound is explained at view/6.

%!  start_generating is det.
%
%   Forget all formulas, and enter the predicates of the data as the formulas of cost 0.

start_generating :-
    forall(member(Head, [ item(_,_,_,_,_), bucket(_,_,_,_,_), meta(_,_,_,_,_,_),
                          plan(_,_,_,_,_,_,_), trie_key(_,_) ]),
           retractall(Head)),
    forall(counter(_, Key), nb_setval(Key, 0)),
    nb_setval(next_id, 1),
    nb_setval(unit_start, 1),
    make_plans,
    forall(view(Kind, Class, Name, Positions, Bound, Bits),
           enter_view(Bits, Kind, Class, Name, Positions, Bound)).

enter_view(none, _, _, _, _, _) :-
    !,
    increment(views_too_large).
enter_view(Bits, Kind, Class, Name, Positions, Bound) :-
    length(Positions, Arity),
    ViewClass =.. [Kind, Class],
    mask(Class, Mask),
    new_bucket(ViewClass, 0, Arity, -, Bucket),
    trie(ViewClass, Trie),
    offer(Bucket, Trie, Mask, new(view(Name, Positions), [], Bound, 1, 0, 0, -), Bits).

% plan(ResultKind, Operands, Result, Cost, Shared, Commutative, Rules): rules of the same shape, tried
% together so that an operand is fetched (and lifted) once for all of them. Shared is how many variables
% the operands have in common.

make_plans :-
    findall(shape(Operands, Result, Cost, Commutative)-rule(Name, Index, Implications),
            ( grammar_rule(Index, Name, Operands, Result, Cost, Commutative, Implications) ),
            Rules),
    group(Rules).

group([]).
group([Shape-Rule|Rules]) :-
    partition([S-_]>>(S =@= Shape), Rules, Same, Others),
    findall(R, member(_-R, Same), Rs),
    Shape = shape(Operands, Result, Cost, Commutative),
    shared_variables(Operands, Shared),
    result_kind(Result, Kind),
    assertz(plan(Kind, Operands, Result, Cost, Shared, Commutative, [Rule|Rs])),
    group(Others).

% In a rule, a sort variable stands for a variable of the formula.
shared_variables([_], 0) :- !.
shared_variables(Operands, Shared) :-
    maplist(arity, Operands, Arities),
    sum_list(Arities, Sum),
    max_list(Arities, Max),
    term_variables(Operands, Variables),
    length(Variables, Distinct),
    Shared is Sum - max(Max, Distinct).

arity(prop, 0).
arity(con(_), 1).
arity(imp(_), 1).
arity(role(_,_), 2).
arity(triple(_,_,_), 3).
arity(pred(Class), N) :- arity(Class, N).
arity(test(Class), N) :- arity(Class, N).
arity(own(Class), N) :- arity(Class, N).
arity(link(Class), N) :- arity(Class, N).

result_kind(Result, any) :- var(Result), !.
result_kind(Result, Kind) :- functor(Result, Kind, _).

%!  generate_level(+Cost:nonneg) is det.
%
%   Make all formulas whose cost is exactly Cost. The levels below must have been made before.

generate_level(Cost) :-
    forall(( between(0, Cost, Literals),
             between(0, Cost, Variables),
             Cost =:= max(Literals, Variables) ),
           generate_unit(Literals, Variables)).

% Rules that cost nothing make con(X) from roles of the same unit: kinds with more variables come first.

generate_unit(Literals, Variables) :-
    nb_getval(next_id, Start),
    nb_setval(unit_start, Start),
    forall(( member(Kind, [any, triple, role, imp, con, prop]),
             plan(Kind, Operands, Result, Cost, Shared, Commutative, Rules) ),
           apply_plan(Operands, Result, Cost, Shared, Commutative, Rules, Literals, Variables)).

apply_plan(Operands, Result, Cost, Shared, Commutative, Rules, Literals, Variables) :-
    forall(( select_buckets(Operands, Commutative, Rules, Buckets, L0, V0),
             Literals =:= L0 + Cost,
             Variables =:= V0 - Shared,
             allowed(Result, Literals, Variables),
             shape(Result, _, _) ),
           combine(Buckets, Operands, Result, Commutative, Rules, Literals, Variables)).

select_buckets([A], _, _, [BucketA], L, V) :-
    bucket(BucketA, A, L, V, _).
select_buckets([A,B], Commutative, Rules, [BucketA,BucketB], L, V) :-
    bucket(BucketA, A, LA, VA, _),
    bucket(BucketB, B, LB, VB, Made),
    \+ ( Commutative == true, Rules = [rule(Made, _, _)|_] ),
    L is LA + LB,
    V is VA + VB.

allowed(Class, Literals, Variables) :-
    functor(Class, Kind, _),
    (   cap(Kind, Limit)
    ->  max(Literals, Variables) =< Limit
    ;   true
    ).

combine(Buckets, Operands, Result, Commutative, Rules, Literals, Variables) :-
    mask(Result, Mask),
    trie(Result, Trie),
    ( cap(implication, Cap) -> true ; Cap = inf ),
    made(Commutative, Rules, Made),
    new_bucket(Result, Literals, Variables, Made, Bucket),
    (   combine_(Buckets, Operands, Result, Commutative, Rules, Cap, New, Bits),
        offer(Bucket, Trie, Mask, New, Bits),
        fail
    ;   true
    ).

made(true, [rule(Name, _, _)|_], Name).
made(false, _, -).

combine_([BucketA], Operands, Result, _, Rules, Cap, new(Name, [A], _, _, Index, Implications, -), Bits) :-
    item(BucketA, A, _, ImpA, BitsA),
    member(rule(Name, Index, Imp), Rules),
    Implications is ImpA + Imp,
    Implications =< Cap,
    sem(Name, Operands, Result, [BitsA], Bits).
combine_([BucketA,BucketB], Operands, Result, Commutative, Rules, Cap,
         new(Name, [A,B], _, _, Index, Implications, Last), Bits) :-
    item(BucketA, A, LastA, ImpA, BitsA),
    warm(Operands, BitsA),
    item(BucketB, B, _, ImpB, BitsB),
    (   Commutative == true
    ->  LastA < B,
        Last = B
    ;   Last = (-)
    ),
    member(rule(Name, Index, Imp), Rules),
    Implications is ImpA + ImpB + Imp,
    Implications =< Cap,
    sem(Name, Operands, Result, [BitsA,BitsB], Bits).

% offer(+Bucket, +Trie, +Mask, +New, +Bits): keep a formula if it says something new. Among formulas that
% mean the same on the data and have equally many literals and variables, the better one is kept.

offer(Bucket, Trie, Mask, New, Bits) :-
    increment(candidates),
    (   ( Bits =:= 0 ; Bits =:= Mask )
    ->  increment(constant)
    ;   trie_lookup(Trie, Bits, Old)
    ->  increment(same_denotation),
        nb_getval(unit_start, Start),
        (   Old >= Start,
            better(New, Old)
        ->  retract(meta(Old, _, _, _, _, _)),
            retract(item(_, Old, _, _, _)),
            keep(Bucket, Old, New, Bits)
        ;   true
        )
    ;   nb_getval(next_id, Id),
        Id1 is Id + 1,
        nb_setval(next_id, Id1),
        trie_insert(Trie, Bits, Id),
        keep(Bucket, Id, New, Bits)
    ).

keep(Bucket, Id, New, Bits) :-
    New = new(Rule, Operands, Bound, _, _, Implications, Last0),
    size_and_rank(New, Size, Rank),
    bound_of(Rule, Operands, Bound),
    ( Last0 == (-) -> Last = Id ; Last = Last0 ),
    assertz(meta(Id, Size, Rank, Bound, Rule, Operands)),
    assertz(item(Bucket, Id, Last, Implications, Bits)).

size_and_rank(new(view(Name, Positions), [], _, _, Rank, _, _), Size, Rank) :-
    !,
    predicate(Name, Sorts),
    length(Sorts, Arity),
    length(Positions, Shown),
    Size is 1 + Arity - Shown.
size_and_rank(new(_, Operands, _, _, Index, _, _), Size, Rank) :-
    findall(S-R, ( member(Id, Operands), meta(Id, S, R, _, _, _) ), Pairs),
    foldl([S-R, S0-R0, S1-R1]>>(S1 is S0+S, R1 is R0+R), Pairs, 1-Index, Size-Rank).

bound_of(_, _, Bound) :-
    nonvar(Bound),
    !.
bound_of(Rule, Operands, Bound) :-
    findall(B, ( member(Id, Operands), meta(Id, _, _, B, _, _) ), Bounds),
    (   bound(Rule, Bounds, Bound)
    ->  true
    ;   Bound = many
    ).

% Fewer symbols, then rules that stand earlier in the grammar, then the standard order of the formulas:
% nothing that depends on how entities or states are numbered.

better(New, Old) :-
    size_and_rank(New, Size, Rank),
    meta(Old, Size0, Rank0, _, Rule0, Operands0),
    compare(Order, Size-Rank, Size0-Rank0),
    (   Order == (<)
    ->  true
    ;   Order == (=),
        New = new(Rule, Operands, _, _, _, _, _),
        formula(Rule, Operands, F),
        formula(Rule0, Operands0, F0),
        F @< F0
    ).

new_bucket(Class, Literals, Variables, Made, Bucket) :-
    bucket(Bucket, Class, Literals, Variables, Made),
    !.
new_bucket(Class, Literals, Variables, Made, Bucket) :-
    aggregate_all(count, bucket(_, _, _, _, _), Bucket),
    assertz(bucket(Bucket, Class, Literals, Variables, Made)).

trie(Class, Trie) :-
    trie_key(Class, Key),
    !,
    nb_getval(Key, Trie).
trie(Class, Trie) :-
    trie_new(Trie),
    term_to_atom(trie(Class), Key),
    nb_setval(Key, Trie),
    assertz(trie_key(Class, Key)).

%!  count(?What, -Number) is nondet.
%
%   How often something happened since start_generating/0: formulas tried (`candidates`), those that are
%   always true or false (`constant`), those with the denotation of another (`same_denotation`), formulas
%   kept (`formulas`), and views of predicates too large for a bit vector (`views_too_large`).

count(What, Number) :-
    counter(What, Key),
    nb_getval(Key, Number).
count(formulas, Number) :-
    nb_getval(next_id, Next),
    Number is Next - 1.

counter(candidates, count_candidates).
counter(constant, count_constant).
counter(same_denotation, count_same_denotation).
counter(views_too_large, count_views_too_large).

increment(What) :-
    counter(What, Key),
    nb_getval(Key, N0),
    N is N0 + 1,
    nb_setval(Key, N).
