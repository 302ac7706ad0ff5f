:- module(generate,
          [ start_generating/0,
            generate_level/1,       % +Cost
            item/6,                 % ?Bucket, ?Id, ?Last, ?Implications, ?Rule, ?Bits
            bucket/5,               % ?Bucket, ?Class, ?Literals, ?Variables, ?Made
            meta/6,                 % ?Id, ?Size, ?Rank, ?Bound, ?Rule, ?Operands
            formula_count/1,        % -Number
            rule_count/4            % +Cost, ?Rule, ?What, -Number
          ]).
:- use_module(library(aggregate), [aggregate_all/3]).
:- use_module(library(apply), [maplist/3, partition/4]).
:- use_module(library(lists), [max_list/2, member/2, sum_list/2]).
:- autoload(library(yall), [(>>)/3]).
:- use_module(concepts, [concept/4, concept_view/4]).
:- use_module(engine, [mask/2, shape/3, warm/2]).
:- use_module(facts, [predicate/2]).
:- use_module(formula, [formula/3, formula_size/2]).
:- use_module(rules, [bound/3, cap/2, grammar_rule/7, pruning/1, rule_failed/3, rule_law/4, sem/5]).
:- use_module(views, [view/6]).
:- set_prolog_flag(optimise, true).

/** <module> Formulas, level by level

    ?- pool_grammar(['logic/grammar.lp']), pool_open('tests/logic/cup.pl'), generate_level(0), generate_level(1),
       item(Bucket, Id, _, _, negated, Bits), bucket(Bucket, Class, Literals, Variables, _),
       meta(Id, _, _, _, Rule, Operands).
    Class = con(pose), Literals = 1, Variables = 1, Rule = negated.

Level K makes all formulas of cost K from cheaper ones (and from formulas of the same cost with fewer
literals), and prunes at once:

  - by _equivalence_: what a law of the grammar (law/3) says is equal to a formula made elsewhere is not
    even evaluated, and neither are the other orders of a set of operands;
  - by _uniqueness_: a formula is kept only if no earlier one of the same class has the same denotation on
    the data, and if it is neither always true nor always false. Everything built from a dropped formula
    equals something built from the kept one at no greater cost.

Formulas live in the database, not on the stacks, and the loops are failure-driven, so that nothing is
left for the garbage collector:

    item(Bucket, Id, Last, Implications, Rule, Bits)
    bucket(Bucket, Class, Literals, Variables, Made)    what the items of a bucket have in common
    meta(Id, Size, Rank, Bound, Rule, Operands)         what only the formulas kept need

A set of operands of a commutative rule is built once, in ascending order of Id: Made is that rule's
name (and - for all other items), Last the Id of the last operand.
*/

:- dynamic
    item/6, bucket/5, meta/6,
    plan/7,                     % ResultKind, Operands, Result, Cost, Shared, Commutative, Rules
    trie_key/2,                 % Class, Key
    rule_count/4.

%!  bucket(?Bucket, ?Class, ?Literals, ?Variables, ?Made) is nondet.
%
%   The items of Bucket are formulas of Class with these numbers of literals (rule costs, to be precise) and
%   variables.

%!  item(?Bucket, ?Id, ?Last, ?Implications, ?Rule, ?Bits) is nondet.
%
%   Formula Id, made by Rule, has the denotation Bits.

%!  meta(?Id, ?Size, ?Rank, ?Bound, ?Rule, ?Operands) is nondet.
%
%   Formula Id is the result of Rule (or a view) for the items Operands. Size counts its rules and the arguments
%   that views hide behind a quantifier, Rank adds up their places in the grammar; Bound is explained at view/6.

%!  start_generating is det.
%
%   Forget all formulas, and enter the predicates of the data as the formulas of cost 0.

start_generating :-
    forall(member(Head, [ item(_,_,_,_,_,_), bucket(_,_,_,_,_), meta(_,_,_,_,_,_),
                          plan(_,_,_,_,_,_,_), trie_key(_,_), rule_count(_,_,_,_) ]),
           retractall(Head)),
    start_counting,
    nb_setval(next_id, 1),
    nb_setval(unit_start, 1),
    ( pruning(uniqueness) -> Unique = true ; Unique = false ),
    nb_setval(uniqueness, Unique),
    make_plans,
    forall(view(Kind, Class, Name, Positions, Bound, Bits),
           ( functor(Class, _, Arity),
             enter_view(Bits, Kind, Class, 0, Arity, Bound, view(Name, Positions)) )),
    forall(concept_view(Concept, Class, Cost, Bits),
           ( Literals is Cost - 1,
             functor(Class, _, Arity),
             enter_view(Bits, pred, Class, Literals, Arity, many, Concept) )),
    finish_counting(views).

enter_view(none, _, _, _, _, _, _) :-
    !,
    count(0, too_large).
enter_view(Bits, Kind, Class, Literals, Arity, Bound, View) :-
    ViewClass =.. [Kind, Class],
    mask(Class, Mask),
    new_bucket(ViewClass, Literals, Arity, -, Bucket),
    trie(ViewClass, Trie),
    offer(Bucket, Trie, Mask, new(View, [], Bound, 0, 0, -), Bits).

% plan(ResultKind, Operands, Result, Cost, Shared, Commutative, Rules): rules of the same shape, tried
% together so that an operand is fetched (and lifted) once for all of them. Shared is how many variables
% the operands have in common.

make_plans :-
    findall(shape(Operands, Result, Cost, Commutative)-rule(Name, Index, Implications, Laws),
            ( grammar_rule(Index, Name, Operands, Result, Cost, Commutative, Implications),
              ( rule_law(Name, _, _, _) -> Laws = true ; Laws = false ) ),
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
    start_counting,
    forall(( between(0, Cost, Literals),
             between(0, Cost, Variables),
             Cost =:= max(Literals, Variables) ),
           generate_unit(Literals, Variables)),
    finish_counting(Cost).

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
    \+ ( Commutative == true, Rules = [rule(Made, _, _, _)|_] ),
    \+ \+ item(BucketA, _, _, _, _, _),
    \+ \+ item(BucketB, _, _, _, _, _),
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

made(true, [rule(Name, _, _, _)|_], Name).
made(false, _, -).

combine_([BucketA], Operands, Result, _, Rules, Cap, new(Name, [A], _, Index, Implications, -), Bits) :-
    item(BucketA, A, _, ImpA, RuleA, BitsA),
    member(rule(Name, Index, Imp, Laws), Rules),
    Implications is ImpA + Imp,
    Implications =< Cap,
    lawful(Laws, Name, RuleA, -, [A], Index),
    denote(Name, Operands, Result, [BitsA], Bits).
combine_([BucketA,BucketB], Operands, Result, Commutative, Rules, Cap,
         new(Name, [A,B], _, Index, Implications, Last), Bits) :-
    item(BucketA, A, LastA, ImpA, RuleA, BitsA),
    warm(Operands, BitsA),
    item(BucketB, B, _, ImpB, RuleB, BitsB),
    (   Commutative == true
    ->  LastA < B,
        Last = B
    ;   Last = (-)
    ),
    member(rule(Name, Index, Imp, Laws), Rules),
    Implications is ImpA + ImpB + Imp,
    Implications =< Cap,
    lawful(Laws, Name, RuleA, RuleB, [A,B], Index),
    denote(Name, Operands, Result, [BitsA,BitsB], Bits).

% lawful(+Laws, +Rule, +RuleA, +RuleB, +Operands, +Index): no law says that the result is made elsewhere.

lawful(false, _, _, _, _, _).
lawful(true, Name, RuleA, RuleB, Operands, Index) :-
    (   rule_law(Name, RuleA, RuleB, Patterns),
        match_all(Patterns, Operands)
    ->  count(Index, equivalent),
        fail
    ;   true
    ).

match_all([], []).
match_all([Pattern|Patterns], [Id|Ids]) :-
    match(Pattern, Id),
    match_all(Patterns, Ids).

match(Pattern, Id) :-
    var(Pattern),
    !,
    Pattern = Id.
match(Id, Id) :-
    !.
match(Pattern, Id) :-
    compound(Pattern),
    Pattern =.. [Rule|Patterns],
    meta(Id, _, _, _, Rule, Ids),
    match_all(Patterns, Ids).

denote(Name, Operands, Result, Bits, D) :-
    sem(Name, Operands, Result, Bits, D),
    !.
denote(Name, Operands, Result, _, _) :-
    rule_failed(Name, Operands, Result).

% offer(+Bucket, +Trie, +Mask, +New, +Bits): keep a formula if it says something new. Among formulas that
% mean the same on the data and have equally many literals and variables, the better one is kept. New is
% new(Rule, Operands, Bound, Index, Implications, Last).

offer(Bucket, Trie, Mask, New, Bits) :-
    arg(4, New, Index),
    (   \+ nb_getval(uniqueness, true)
    ->  keep_new(Bucket, New, Bits, Index, _)
    ;   ( Bits =:= 0 ; Bits =:= Mask )
    ->  count(Index, constant)
    ;   trie_lookup(Trie, Bits, Old)
    ->  nb_getval(unit_start, Start),
        (   Old >= Start,
            better(New, Old)
        ->  count(Index, better),
            retract(meta(Old, _, _, _, _, _)),
            retract(item(_, Old, _, _, _, _)),
            keep(Bucket, Old, New, Bits)
        ;   count(Index, same)
        )
    ;   keep_new(Bucket, New, Bits, Index, Id),
        trie_insert(Trie, Bits, Id)
    ).

keep_new(Bucket, New, Bits, Index, Id) :-
    count(Index, new),
    nb_getval(next_id, Id),
    Id1 is Id + 1,
    nb_setval(next_id, Id1),
    keep(Bucket, Id, New, Bits).

keep(Bucket, Id, New, Bits) :-
    New = new(Rule, Operands, Bound, Index, Implications, Last0),
    size_and_rank(Rule, Operands, Index, Size, Rank),
    bound_of(Rule, Operands, Bound),
    ( Last0 == (-) -> Last = Id ; Last = Last0 ),
    functor(Rule, Name, _),
    assertz(meta(Id, Size, Rank, Bound, Rule, Operands)),
    assertz(item(Bucket, Id, Last, Implications, Name, Bits)).

% Size counts rules, arguments that views hide behind a quantifier, and the symbols of concepts.

size_and_rank(view(Name, Positions), [], _, Size, 0) :-
    !,
    predicate(Name, Sorts),
    length(Sorts, Arity),
    length(Positions, Shown),
    Size is 1 + Arity - Shown.
size_and_rank(concept(Name, _), [], _, Size, 0) :-
    !,
    concept(Name, _, _, Formula),
    formula_size(Formula, Size).
size_and_rank(_, [A], Index, Size, Rank) :-
    !,
    meta(A, SizeA, RankA, _, _, _),
    Size is SizeA + 1,
    Rank is RankA + Index.
size_and_rank(_, [A,B], Index, Size, Rank) :-
    meta(A, SizeA, RankA, _, _, _),
    meta(B, SizeB, RankB, _, _, _),
    Size is SizeA + SizeB + 1,
    Rank is RankA + RankB + Index.

bound_of(_, _, Bound) :-
    nonvar(Bound),
    !.
bound_of(Rule, Operands, Bound) :-
    bounds(Operands, Bounds),
    (   bound(Rule, Bounds, Bound0)
    ->  Bound = Bound0
    ;   Bound = many
    ).

bounds([], []).
bounds([Id|Ids], [Bound|Bounds]) :-
    meta(Id, _, _, Bound, _, _),
    bounds(Ids, Bounds).

% Fewer symbols, then rules that stand earlier in the grammar, then the standard order of the formulas:
% nothing that depends on how entities or states are numbered.

better(new(Rule, Operands, _, Index, _, _), Old) :-
    size_and_rank(Rule, Operands, Index, Size, Rank),
    meta(Old, Size0, Rank0, _, Rule0, Operands0),
    compare(Order, Size-Rank, Size0-Rank0),
    (   Order == (<)
    ->  true
    ;   Order == (=),
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

%!  formula_count(-Number) is det.
%
%   How many formulas were kept since start_generating/0.

formula_count(Number) :-
    nb_getval(next_id, Next),
    Number is Next - 1.

%!  rule_count(?Level, ?Rule, ?What, -Number) is nondet.
%
%   What became of the candidates of Rule on Level (the predicates: rule and level `views`):
%
%     - `equivalent`: a law says that they are made elsewhere; never evaluated
%     - `constant`: always true or always false
%     - `same`: the denotation of a formula made earlier
%     - `better`: the same, but shorter, so that they replaced it
%     - `new`: kept, unless replaced later
%     - `too_large`: predicates that no bit vector can hold

% One term holds all counters of a level, because it can be changed in place.

counter(equivalent, 1).
counter(constant, 2).
counter(same, 3).
counter(better, 4).
counter(new, 5).
counter(too_large, 6).

start_counting :-
    findall(I, grammar_rule(I, _, _, _, _, _, _), Is),
    max_list([0|Is], Max),
    Size is (Max + 1) * 6,
    functor(Counts, counts, Size),
    forall(between(1, Size, I), nb_setarg(I, Counts, 0)),
    nb_setval(counts, Counts).

count(Index, What) :-
    counter(What, Offset),
    I is Index * 6 + Offset,
    nb_getval(counts, Counts),
    arg(I, Counts, C0),
    C is C0 + 1,
    nb_setarg(I, Counts, C).

finish_counting(Level) :-
    nb_getval(counts, Counts),
    forall(( ( Index = 0, Rule = views ; grammar_rule(Index, Rule, _, _, _, _, _) ),
             counter(What, Offset),
             I is Index * 6 + Offset,
             arg(I, Counts, Number),
             Number > 0 ),
           assertz(rule_count(Level, Rule, What, Number))).
