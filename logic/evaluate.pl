:- module(evaluate,
          [ denotation/4            % +Formula, +Variables, +Class, -Bits
          ]).
:- use_module(library(apply), [foldl/4, partition/4]).
:- use_module(library(assoc), [get_assoc/3, list_to_assoc/2]).
:- use_module(library(lists), [append/3, member/2, nth1/3, nth1/4, selectchk/3]).
:- use_module(library(ordsets), [ord_intersection/3, ord_subset/2, ord_subtract/3, ord_union/3]).
:- use_module(library(pairs), [group_pairs_by_key/2]).
:- autoload(library(yall), [(>>)/3, (>>)/5]).
:- use_module(engine, [assemble/3, mask/2]).
:- use_module(facts, [entity_count/2, entity_count/3, predicate/2, problem_states/2, slot/4, state_count/1, tuple/4]).
:- set_prolog_flag(optimise, true).

/** <module> The exact value of one formula, whatever its arity

    ?- read_facts('tests/logic/cup.pl'), engine_setup,
       denotation(some(v1, object, on(v0, v1)), [v0-object], con(object), Bits).
    Bits = 0b101.

The pool's bit vectors hold the assignments of at most three variables. A formula that a person writes may have
more; it is evaluated here by relational algebra on _tables_, the satisfying assignments and the states in which
they satisfy:

    table(Variables, Rows)      Variables in standard order; Rows a sorted list Slots-States, no set of states empty

Slots number the entities of a problem (slot/4), so that a row speaks of all problems at once. A conjunction is a
join; a negated conjunct whose variables are bound by the others is a difference; any other negation is a
difference from the product of its variables' sorts.
*/

product_limit(4_000_000).

%!  denotation(+Formula, +Variables:list, +Class, -Bits) is det.
%
%   Bits is the set of assignments and states that satisfy Formula, laid out as Class prescribes. Variables are
%   the free variables Name-Sort in the order of Class.
%
%   @error notation_error(1, Message) if a negation speaks of too many assignments

denotation(Formula, Variables, Class, Bits) :-
    reduce(Formula, F),
    value(F, Variables, Table0),
    findall(Name, member(Name-_, Variables), Names0),
    sort(Names0, Names),
    widen(Table0, Names, Variables, table(_, Rows)),
    state_count(S),
    findall(Index-States,
            ( member(Slots-States, Rows),
              index(Variables, Names, Slots, 0, Index) ),
            Blocks),
    assemble(Blocks, S, Bits0),
    mask(Class, Mask),
    Bits is Bits0 /\ Mask.

index([], _, _, Index, Index).
index([Name-Sort|Variables], Names, Slots, Index0, Index) :-
    nth1(I, Names, Name),
    nth1(I, Slots, Slot),
    !,
    entity_count(Sort, N),
    Index1 is Index0*N + Slot,
    index(Variables, Names, Slots, Index1, Index).

% reduce(+Formula, -Reduced): only conjunction, disjunction, negation, `some` and `closure` remain.

reduce(true, true) :- !.
reduce(neg(A), F) :- !, reduce(A, A1), negation(A1, F).
reduce(conj(A, B), conj(F, G)) :- !, reduce(A, F), reduce(B, G).
reduce(disj(A, B), disj(F, G)) :- !, reduce(A, F), reduce(B, G).
reduce(implies(A, B), F) :-
    !,
    reduce(A, A1),
    reduce(B, B1),
    negation(B1, NotB),
    negation(conj(A1, NotB), F).
reduce(some(V, T, A), some(V, T, F)) :- !, reduce(A, F).
reduce(every(V, T, A), F) :-
    !,
    reduce(A, A1),
    negation(A1, NotA),
    negation(some(V, T, NotA), F).
reduce(closure(U, W, T, A, Y, X), closure(U, W, T, F, Y, X)) :- !, reduce(A, F).
reduce(Atom, Atom).

negation(neg(F), F) :- !.
negation(F, neg(F)).

% value(+Reduced, +Sorts, -Table): Sorts are pairs Variable-Sort of all variables in scope.

value(true, _, table([], [[]-All])) :-
    !,
    all_states(All).
value(neg(F), Sorts, Table) :-
    !,
    value(F, Sorts, T),
    complement_of(T, Sorts, Table).
value(conj(A, B), Sorts, Table) :-
    !,
    conjuncts(conj(A, B), Cs, []),
    partition([neg(_)]>>true, Cs, Negative, Positive),
    all_states(All),
    join_all(Positive, Sorts, table([], [[]-All]), Table0),
    foldl(without(Sorts), Negative, Table0, Table).
value(disj(A, B), Sorts, table(Vs, Rows)) :-
    !,
    value(A, Sorts, TA),
    value(B, Sorts, TB),
    TA = table(VA, _),
    TB = table(VB, _),
    ord_union(VA, VB, Vs),
    widen(TA, Vs, Sorts, table(_, RA)),
    widen(TB, Vs, Sorts, table(_, RB)),
    append(RA, RB, Rows0),
    united(Rows0, Rows).
value(some(V, T, F), Sorts, Table) :-
    !,
    value(F, [V-T|Sorts], table(Vs, Rows)),
    (   nth1(I, Vs, V)
    ->  selectchk(V, Vs, Others),
        findall(Slots-States, ( member(Slots0-States, Rows), nth1(I, Slots0, _, Slots) ), Rows0),
        united(Rows0, Rows1),
        Table = table(Others, Rows1)
    ;   existing(T, 0, States),
        restricted(Rows, States, Rows1),
        Table = table(Vs, Rows1)
    ).
value(closure(U, W, T, F, Y, X), Sorts, Table) :-
    !,
    Variables = [U-T, W-T],
    value(F, [U-T, W-T|Sorts], Table0),
    sort([U,W], Vs),
    Table0 = table(Vs0, _),
    (   ord_subset(Vs0, Vs)
    ->  true
    ;   throw(error(notation_error(1, "a closure cannot depend on other variables"), _))
    ),
    widen(Table0, Vs, Variables, table(_, Rows)),
    ( Vs == [U,W] -> Pairs = Rows ; findall([B,A]-S, member([A,B]-S, Rows), Pairs) ),
    transitive(Pairs, Closed),
    atom_rows([Y,X], Closed, Table).
value(Atom, _, Table) :-
    Atom =.. [Name|Vs],
    predicate(Name, Sorts),
    findall(Slots-States,
            ( tuple(Name, P, States, Arguments),
              slots(Arguments, Sorts, P, Slots) ),
            Rows),
    atom_rows(Vs, Rows, Table).

slots([], [], _, []).
slots([E|Es], [T|Ts], P, [I|Is]) :-
    slot(E, P, T, I),
    !,
    slots(Es, Ts, P, Is).

% atom_rows(+Variables, +Rows, -Table): Rows are tuples of Variables, which may repeat.

atom_rows(Vs0, Rows0, table(Vs, Rows)) :-
    sort(Vs0, Vs),
    findall(Slots-States,
            ( member(Slots0-States, Rows0),
              bindings(Vs0, Slots0, [], Bindings),
              values(Vs, Bindings, Slots) ),
            Rows1),
    united(Rows1, Rows).

bindings([], [], Bindings, Bindings).
bindings([V|Vs], [I|Is], Bindings0, Bindings) :-
    (   memberchk(V-I0, Bindings0)
    ->  I0 =:= I,
        Bindings1 = Bindings0
    ;   Bindings1 = [V-I|Bindings0]
    ),
    bindings(Vs, Is, Bindings1, Bindings).

values([], _, []).
values([V|Vs], Bindings, [I|Is]) :-
    memberchk(V-I, Bindings),
    values(Vs, Bindings, Is).

% united(+Rows, -Table): sort rows and unite those of one assignment.

united(Rows0, Rows) :-
    keysort(Rows0, Rows1),
    unite(Rows1, Rows).

unite([], []).
unite([Slots-S1,Slots2-S2|Rows0], Rows) :-
    Slots == Slots2,
    !,
    S is S1 \/ S2,
    unite([Slots-S|Rows0], Rows).
unite([_-0|Rows0], Rows) :-
    !,
    unite(Rows0, Rows).
unite([Row|Rows0], [Row|Rows]) :-
    unite(Rows0, Rows).

restricted([], _, []).
restricted([Slots-S0|Rows0], States, Rows) :-
    S is S0 /\ States,
    ( S =:= 0 -> Rows = Rows1 ; Rows = [Slots-S|Rows1] ),
    restricted(Rows0, States, Rows1).

conjuncts(conj(A, B), Cs0, Cs) :-
    !,
    conjuncts(A, Cs0, Cs1),
    conjuncts(B, Cs1, Cs).
conjuncts(F, [F|Cs], Cs).

% Join with what shares variables first, so that products stay small.

join_all([], _, Table, Table).
join_all(Fs, Sorts, Table0, Table) :-
    findall(Size-(F-T), ( member(F, Fs), value(F, Sorts, T), T = table(_, Rows), length(Rows, Size) ), Sized0),
    keysort(Sized0, Sized),
    findall(T, member(_-(_-T), Sized), Tables),
    join_tables(Tables, Table0, Table).

join_tables([], Table, Table).
join_tables(Tables, Table0, Table) :-
    Table0 = table(Vs0, _),
    (   member(Next, Tables),
        Next = table(Vs, _),
        ord_intersection(Vs0, Vs, [_|_])
    ->  true
    ;   Tables = [Next|_]
    ),
    selectchk(Next, Tables, Others),
    join_tables_(Table0, Next, Table1),
    join_tables(Others, Table1, Table).

join_tables_(table(V1, R1), table(V2, R2), table(Vs, Rows)) :-
    ord_union(V1, V2, Vs),
    ord_intersection(V1, V2, Shared),
    positions(Shared, V1, I1),
    positions(Shared, V2, I2),
    ord_subtract(V2, V1, New),
    positions(New, V2, I3),
    append(V1, New, Order),
    positions(Vs, Order, Final),
    findall(Key-(Slots-S), ( member(Row-S, R2), picked(I2, Row, Key), picked(I3, Row, Slots) ), Keyed0),
    keysort(Keyed0, Keyed),
    group_pairs_by_key(Keyed, Groups),
    list_to_assoc(Groups, Assoc),
    findall(Slots-S,
            ( member(Row1-S1, R1),
              picked(I1, Row1, Key),
              get_assoc(Key, Assoc, Group),
              member(More-S2, Group),
              S is S1 /\ S2,
              S =\= 0,
              append(Row1, More, Slots0),
              picked(Final, Slots0, Slots) ),
            Rows0),
    united(Rows0, Rows).

positions([], _, []).
positions([V|Vs], All, [I|Is]) :-
    nth1(I, All, V),
    !,
    positions(Vs, All, Is).

picked([], _, []).
picked([I|Is], Row, [X|Xs]) :-
    nth1(I, Row, X),
    !,
    picked(Is, Row, Xs).

% without(+Sorts, +Negation, +Table0, -Table): Table0 where the negated formula is false.

without(Sorts, neg(F), Table0, Table) :-
    value(F, Sorts, T),
    Table0 = table(Vs0, Rows0),
    T = table(Vs, Rows),
    (   ord_subset(Vs, Vs0)
    ->  list_to_assoc(Rows, Assoc),
        positions(Vs, Vs0, Is),
        findall(Row-S,
                ( member(Row-S0, Rows0),
                  picked(Is, Row, Key),
                  ( get_assoc(Key, Assoc, S1) -> S is S0 /\ \S1 ; S = S0 ),
                  S =\= 0 ),
                Rows1),
        Table = table(Vs0, Rows1)
    ;   complement_of(T, Sorts, C),
        join_tables_(Table0, C, Table)
    ).

% complement_of(+Table, +Sorts, -Complement): all assignments of entities that exist, less the table's.

complement_of(table(Vs, Rows), Sorts, table(Vs, Complement)) :-
    all_states(All),
    assignments(Vs, Sorts, table([], [[]-All]), table(_, Everything)),
    subtract_rows(Everything, Rows, Complement).

subtract_rows([], _, []).
subtract_rows([Row|Rows], [], [Row|Rows]) :- !.
subtract_rows([Slots-S0|Rows0], [Slots1-S1|Rows1], Rows) :-
    (   Slots == Slots1
    ->  S is S0 /\ \S1,
        ( S =:= 0 -> Rows = Rows2 ; Rows = [Slots-S|Rows2] ),
        subtract_rows(Rows0, Rows1, Rows2)
    ;   Rows = [Slots-S0|Rows2],
        subtract_rows(Rows0, [Slots1-S1|Rows1], Rows2)
    ).

% widen(+Table, +Variables, +Sorts, -Wider): the same said of more variables.

widen(table(Vs, Rows), Wanted, Sorts, Table) :-
    ord_subtract(Wanted, Vs, New),
    (   New == []
    ->  Table = table(Vs, Rows)
    ;   all_states(All),
        assignments(New, Sorts, table([], [[]-All]), More),
        join_tables_(table(Vs, Rows), More, Table)
    ).

assignments(Vs, Sorts, Table0, Table) :-
    foldl([V, N0, N]>>( memberchk(V-T, Sorts), entity_count(T, M), N is N0 * M ), Vs, 1, Product),
    product_limit(Limit),
    (   Product =< Limit
    ->  true
    ;   length(Vs, Count),
        format(string(Message), "a negation speaks of ~D assignments of ~d variables; bind some of them outside it",
               [Product, Count]),
        throw(error(notation_error(1, Message), _))
    ),
    foldl(assign(Sorts), Vs, Table0, Table).

assign(Sorts, V, table(Vs0, Rows0), table(Vs, Rows)) :-
    memberchk(V-T, Sorts),
    append(Vs0, [V], Vs),
    findall(I-States, ( entity_count(T, N), Top is N-1, between(0, Top, I), existing(T, I, States) ), Slots),
    findall(Row-S,
            ( member(Row0-S0, Rows0),
              member(I-States, Slots),
              S is S0 /\ States,
              S =\= 0,
              append(Row0, [I], Row) ),
            Rows).

% existing(+Sort, +Slot, -States): where the problem has an entity with that number.

existing(T, I, States) :-
    findall(S, ( entity_count(P, T, N), N > I, problem_states(P, S) ), Ss),
    foldl([S, M0, M]>>(M is M0 \/ S), Ss, 0, States).

all_states(All) :-
    state_count(S),
    All is (1<<S) - 1.

% transitive(+Pairs, -Closed): Pairs are rows [From,To]-States.

transitive(Pairs, Closed) :-
    join_tables_(table([a,b], Pairs), table([b,c], Pairs), table(_, Rows0)),
    findall([A,C]-S, member([A,_,C]-S, Rows0), Rows1),
    append(Pairs, Rows1, Rows2),
    united(Rows2, Rows),
    united(Pairs, Sorted),
    (   Rows == Sorted
    ->  Closed = Rows
    ;   transitive(Rows, Closed)
    ).
