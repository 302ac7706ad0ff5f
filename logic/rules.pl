:- module(rules,
          [ load_grammars/2,        % +Files, -Diagnostics
            grammar_rule/7,         % ?Index, ?Name, ?Operands, ?Result, ?Cost, ?Commutative, ?Implications
            sem/5,                  % +Name, +OperandClasses, +ResultClass, +Operands, -Denotation
            says/5,                 % +Name, +OperandClasses, +Operands, +Variables, -Formula
            bound/3,                % ?Name, ?OperandBounds, ?Bound
            cap/2,                  % ?What, ?Limit
            rule_law/4,             % ?Rule, ?RuleA, ?RuleB, -Patterns
            pruning/1,              % +What
            concept_at/6,           % ?Name, ?Variables, ?Formula, ?Cost, ?File, ?Line
            rule_failed/3,          % +Rule, +OperandClasses, +ResultClass
            grammar_error/4,        % +File, +Line, +Format, +Arguments
            op(200, xfx, @)         % Operand@Variables, in says/5
          ]).
:- use_module(library(lists), [append/3, member/2, nth1/3]).
:- use_module(bridge, [message_string/2]).
:- use_module(engine, [meet/3, join/3, complement/3, implies/4, some/3, restrict/4, exclude/4, given/3, diagonal/3,
                       compose/5, closure/3, primitive/1]).
:- use_module(notation, [parse_concept/4]).
:- use_module(terms, [connective/2]).

/** <module> Reading grammar files safely

    ?- load_grammars(['logic/grammar.lp'], Diagnostics), grammar_rule(_, conj, Operands, Result, Cost, Commutative, _).
    Diagnostics = [], Operands = [con(X),con(X)], Result = con(X), Cost = 0, Commutative = true.

A grammar may come from a stranger. It is never consulted: each term is read, and only the clauses that
grammar.lp describes are accepted; the body of a sem/5 clause may call the engine's primitives and nothing
else, so a grammar can compute denotations but not reach a file, a shell or itself.

Whatever is wrong is collected as diagnostic(File, Line, Column, Message).
*/

:- dynamic
    sem/5, says/5, bound/3, cap/2,
    grammar_rule/7,
    rule_at/6,                  % Name, Operands, Result, Cost, File, Line
    clause_at/4,                % Kind, Name, File, Line
    law_at/5,                   % Name, Left, Right, File, Line
    concept_at/6, rule_law/4,
    commutative/1, implication/1, cost/2, off/1,
    found/1.

%!  grammar_rule(?Index, ?Name, ?Operands, ?Result, ?Cost, ?Commutative, ?Implications) is nondet.
%
%   A rule that is switched on: its place in the grammar, its classes, and the notes on it.

%!  sem(+Name, +OperandClasses, +ResultClass, +Operands, -Denotation) is semidet.
%!  says(+Name, +OperandClasses, +Operands, +Variables, -Formula) is semidet.
%!  bound(?Name, ?OperandBounds, ?Bound) is nondet.
%!  cap(?What, ?Limit) is nondet.
%
%   The clauses of the grammar, as grammar.lp describes them.

%!  rule_law(?Rule, ?RuleA, ?RuleB, -Patterns) is nondet.
%
%   What Rule makes of operands that match Patterns is made elsewhere. RuleA and RuleB are the rules that made
%   the operands, where a pattern says so (and - for want of a second operand).

%!  concept_at(?Name, ?Variables, ?Formula, ?Cost, ?File, ?Line) is nondet.
%
%   A concept as written: Formula is what notation.pl read, over the names Variables.

%!  load_grammars(+Files:list, -Diagnostics:list) is det.
%
%   Replace the grammar by the clauses of all Files. Where Diagnostics is not empty the grammar must not
%   be used.

load_grammars(Files, Diagnostics) :-
    forall(member(Head, [ sem(_,_,_,_,_), says(_,_,_,_,_), bound(_,_,_), cap(_,_),
                          grammar_rule(_,_,_,_,_,_,_), rule_at(_,_,_,_,_,_), clause_at(_,_,_,_),
                          law_at(_,_,_,_,_), concept_at(_,_,_,_,_,_), rule_law(_,_,_,_),
                          commutative(_), implication(_), cost(_,_), off(_), found(_) ]),
           retractall(Head)),
    forall(member(File, Files), read_grammar(File)),
    check_grammar,
    index_rules,
    index_laws,
    findall(D, found(D), Diagnostics).

report(File, Line, Column, Format, Arguments) :-
    format(string(Message), Format, Arguments),
    assertz(found(diagnostic(File, Line, Column, Message))).

read_grammar(File) :-
    retractall(cap_of_file(_)),         % a file's own caps add up, and replace those of the files before
    catch(setup_call_cleanup(open(File, read, In, [encoding(utf8)]),
                             read_clauses(In, File),
                             close(In)),
          error(Formal, _),
          ( message_text(Formal, Text),
            report(File, 0, 0, "~w", [Text]) )).

:- dynamic cap_of_file/1.

read_clauses(In, File) :-
    repeat,
    catch(read_one(In, File, Term), Error, (syntax_problem(Error, File), Term = skip)),
    Term == end_of_file,
    !.

read_one(In, File, Term) :-
    read_term(In, Term, [ module(rules), syntax_errors(error), term_position(Position),
                          singletons(Singletons), cycles(false) ]),
    stream_position_data(line_count, Position, Line),
    stream_position_data(line_position, Position, Column0),
    Column is Column0 + 1,
    (   Term == end_of_file
    ->  true
    ;   accept(Term, File, Line, Problem)
    ->  (   var(Problem)
        ->  warn_singletons(Singletons, File, Line, Column)
        ;   report(File, Line, Column, "~w", [Problem])
        )
    ;   functor_text(Term, What),
        report(File, Line, Column, "a grammar cannot contain `~w`", [What])
    ).

syntax_problem(error(syntax_error(What), Where), File) :-
    !,
    (   Where = stream(_, Line, Column0, _)
    ->  Column is Column0 + 1
    ;   Where = file(_, Line, Column0, _)
    ->  Column is Column0 + 1
    ;   Line = 0, Column = 0
    ),
    message_text(syntax_error(What), Text),
    report(File, Line, Column, "~w", [Text]).
syntax_problem(error(Formal, _), File) :-
    message_text(Formal, Text),
    report(File, 0, 0, "~w", [Text]).

message_text(existence_error(source_sink, _), "file not found") :- !.
message_text(permission_error(_, _, _), "file cannot be read") :- !.
message_text(Formal, Text) :-
    message_string(error(Formal, _), Text).

functor_text((:- _), ":- directive") :- !.
functor_text((Head :- _), Text) :- !, functor_text(Head, Text).
functor_text(Term, Text) :-
    callable(Term),
    !,
    functor(Term, Name, Arity),
    format(string(Text), "~q/~d", [Name, Arity]).
functor_text(Term, Text) :-
    format(string(Text), "~q", [Term]).

% A variable that occurs once and does not start with _ is a typing mistake more often than not.
warn_singletons([], _, _, _).
warn_singletons([Name=_|_], File, Line, Column) :-
    report(File, Line, Column, "variable `~w` occurs only once; write `_` if that is meant", [Name]).

% accept(+Term, +File, +Line, -Problem): store a clause of a known kind; Problem stays unbound if it is good.

accept(rule(Name, Operands, Result, Cost), File, Line, Problem) :-
    !,
    (   rule_problem(Name, Operands, Result, Cost, Problem)
    ->  true
    ;   assertz(rule_at(Name, Operands, Result, Cost, File, Line))
    ).
accept((sem(Name, Classes, Class, Operands, D) :- Body), File, Line, Problem) :-
    !,
    (   head_problem(Name, Classes, Operands, Problem)
    ->  true
    ;   term_variables(Classes-Class-Operands, Known),
        body_problem(Body, Known, Computed, Problem0)
    ->  (   nonvar(Problem0)
        ->  Problem = Problem0
        ;   \+ defined(D, Computed)
        ->  Problem = "the denotation (last argument) is never computed"
        ;   assertz((sem(Name, Classes, Class, Operands, D) :- Body)),
            assertz(clause_at(sem, Name, File, Line))
        )
    ).
accept(sem(Name, Classes, Class, Operands, D), File, Line, Problem) :-
    !,
    (   head_problem(Name, Classes, Operands, Problem)
    ->  true
    ;   term_variables(Operands, Known),
        \+ defined(D, Known)
    ->  Problem = "the denotation (last argument) is never computed"
    ;   assertz(sem(Name, Classes, Class, Operands, D)),
        assertz(clause_at(sem, Name, File, Line))
    ).
accept(says(Name, Classes, Operands, Variables, Formula), File, Line, Problem) :-
    !,
    (   head_problem(Name, Classes, Operands, Problem)
    ->  true
    ;   says_problem(Formula, Problem)
    ->  true
    ;   assertz(says(Name, Classes, Operands, Variables, Formula)),
        assertz(clause_at(says, Name, File, Line))
    ).
accept(bound(Name, Bounds, Bound), File, Line, _) :-
    atom(Name), is_list(Bounds),
    assertz(bound(Name, Bounds, Bound)),
    assertz(clause_at(bound, Name, File, Line)).
accept(cap(What, Limit), _, _, _) :-
    atom(What), integer(Limit),
    (   cap_of_file(What)
    ->  true
    ;   retractall(cap(What, _)),
        assertz(cap_of_file(What))
    ),
    assertz(cap(What, Limit)).
accept(commutative(Name), File, Line, _) :-
    atom(Name),
    assertz(commutative(Name)),
    assertz(clause_at(commutative, Name, File, Line)).
accept(implication(Name), File, Line, _) :-
    atom(Name),
    assertz(implication(Name)),
    assertz(clause_at(implication, Name, File, Line)).
accept(off(Name), File, Line, _) :-
    atom(Name),
    assertz(off(Name)),
    assertz(clause_at(off, Name, File, Line)).
accept(cost(Name, Cost), File, Line, Problem) :-
    !,
    (   \+ atom(Name)
    ->  Problem = "the name of a rule must be an atom"
    ;   \+ natural(Cost)
    ->  Problem = "the cost of a rule is a natural number"
    ;   retractall(cost(Name, _)),
        assertz(cost(Name, Cost)),
        assertz(clause_at(cost, Name, File, Line))
    ).
accept(law(Name, Left, Right), File, Line, Problem) :-
    !,
    (   \+ atom(Name)
    ->  Problem = "the name of a law must be an atom"
    ;   \+ ( compound(Left), functor(Left, _, N), between(1, 2, N) )
    ->  Problem = "the left side of a law is a rule with its operands"
    ;   term_variables(Left, Known),
        term_variables(Right, Used),
        member(V, Used),
        \+ defined(V, Known)
    ->  Problem = "the right side of a law has a variable that the left side lacks"
    ;   assertz(law_at(Name, Left, Right, File, Line))
    ).
accept(concept(Head, Text, Cost), File, Line, Problem) :-
    !,
    (   \+ ( text(Head), text(Text) )
    ->  Problem = "a concept is concept(\"Name(x)\", \"formula\", Cost)"
    ;   \+ ( integer(Cost), Cost >= 1 )
    ->  Problem = "the cost of a concept is a positive number"
    ;   catch(( parse_concept(Head-Text, Name, Variables, Formula), Error = none ),
              error(notation_error(Column, Message), _),
              Error = Column-Message),
        (   Error = At-What
        ->  format(string(Problem), "~w (at character ~d of the text)", [What, At])
        ;   concept_at(Name, _, _, _, _, Line0)
        ->  format(string(Problem), "concept `~w` exists already (line ~d)", [Name, Line0])
        ;   assertz(concept_at(Name, Variables, Formula, Cost, File, Line))
        )
    ).

text(Text) :- string(Text), !.
text(Text) :- atom(Text).

natural(N) :- integer(N), N >= 0.

head_problem(Name, _, _, "the name of a rule must be an atom") :-
    \+ atom(Name),
    !.
head_problem(_, Classes, _, "the operand classes are a list, or _") :-
    nonvar(Classes),
    \+ is_list(Classes),
    !.
head_problem(_, _, Operands, "the operands are a list of variables") :-
    \+ ( is_list(Operands), forall(member(V, Operands), var(V)) ).

defined(V, Known) :-
    member(W, Known),
    V == W,
    !.

says_problem(Term, "the formula of a rule is a variable; an operand's is Operand@Variables") :-
    var(Term),
    !.
says_problem(Operand@_, Problem) :-
    !,
    nonvar(Operand),
    Problem = "the left side of @ is an operand".
says_problem(Term, Problem) :-
    (   connective(Term, Parts)
    ->  member(Part, Parts),
        says_problem(Part, Problem)
    ;   functor_text(Term, Text),
        format(string(Problem), "`~w` is no part of a formula", [Text])
    ),
    !.


rule_problem(Name, _, _, _, "the name of a rule must be an atom") :-
    \+ atom(Name),
    !.
rule_problem(Name, _, _, _, Problem) :-
    rule_at(Name, _, _, _, _, Line),
    !,
    format(string(Problem), "rule `~w` exists already (line ~d)", [Name, Line]).
rule_problem(_, Operands, _, _, "the operands of a rule are a list of one or two classes") :-
    \+ ( is_list(Operands), length(Operands, N), between(1, 2, N) ),
    !.
rule_problem(_, Operands, Result, _, Problem) :-
    member(Class, [Result|Operands]),
    \+ known_class(Class),
    !,
    format(string(Problem), "unknown class `~p`", [Class]).
rule_problem(_, _, _, Cost, "the cost of a rule is a natural number") :-
    \+ natural(Cost),
    !.
rule_problem(_, [Class], Result, 0, "a rule from a class to itself must cost at least 1") :-
    same_class(Class, Result).

same_class(Class, Result) :-
    nonvar(Class), nonvar(Result),
    functor(Class, F, N),
    functor(Result, F, N).

known_class(Class) :- var(Class).
known_class(prop).
known_class(con(_)).
known_class(role(_, _)).
known_class(imp(_)).
known_class(triple(_, _, _)).
known_class(pred(_)).
known_class(link(_)).
known_class(own(_)).
known_class(test(_)).

% body_problem(+Body, +Known, -Computed, -Problem): Computed is Known and what Body computes. Every primitive
% computes its last argument from the others.

body_problem(Body, Known, Known, "the body calls a variable") :-
    var(Body),
    !.
body_problem((A, B), Known, Computed, Problem) :-
    !,
    body_problem(A, Known, Known1, Problem0),
    (   nonvar(Problem0)
    ->  Problem = Problem0,
        Computed = Known1
    ;   body_problem(B, Known1, Computed, Problem)
    ).
body_problem(Goal, Known, Known, Problem) :-
    \+ primitive(Goal),
    !,
    functor_text(Goal, Text),
    format(string(Problem), "`~w` is not a primitive of the engine", [Text]).
body_problem(Goal, Known, [D|Known], Problem) :-
    Goal =.. [Name|Arguments],
    append(Inputs, [D], Arguments),
    (   term_variables(Inputs, Used),
        member(V, Used),
        \+ defined(V, Known)
    ->  format(string(Problem), "`~w` uses a variable that is not computed before it", [Name])
    ;   ( nonvar(D) ; defined(D, Known) )
    ->  format(string(Problem), "the last argument of `~w` is its result, a new variable", [Name])
    ;   true
    ).

% Every rule needs a meaning and a text; every other clause needs its rule.

check_grammar :-
    forall(( rule_at(Name, _, _, _, File, Line),
             member(Kind/What, [sem/"sem/5 clause (its meaning)", says/"says/5 clause (its formula)"]),
             \+ clause_at(Kind, Name, _, _) ),
           report(File, Line, 1, "rule `~w` has no ~s", [Name, What])),
    forall(( clause_at(Kind, Name, File, Line),
             \+ rule_at(Name, _, _, _, _, _),
             \+ ( Kind == off, ( Name == uniqueness ; law_at(Name, _, _, _, _) ) ) ),
           report(File, Line, 1, "`~w` speaks of the rule `~w`, which does not exist", [Kind, Name])),
    forall(( law_at(Name, Left, Right, File, Line),
             once(( member(Side, [Left, Right]),
                    unknown_application(Side, Unknown) )) ),
           report(File, Line, 1, "law `~w` speaks of ~w, which is no rule", [Name, Unknown])),
    forall(( cost(Name, 0), rule_at(Name, [Class], Result, _, _, _), same_class(Class, Result),
             clause_at(cost, Name, File, Line) ),
           report(File, Line, 1, "a rule from a class to itself must cost at least 1", [])),
    forall(( rule_at(Name, _, _, _, File, Line), commutative(Name) ),
           (   rule_at(Name, [A,B], _, _, _, _), A =@= B
           ->  true
           ;   report(File, Line, 1, "rule `~w` cannot be commutative: it needs two operands of one class",
                      [Name])
           )).

unknown_application(Term, Unknown) :-
    nonvar(Term),
    \+ memberchk(Term, [true, false]),
    functor(Term, Name, N),
    (   rule_at(Name, Operands, _, _, _, _),
        length(Operands, N)
    ->  arg(_, Term, Argument),
        unknown_application(Argument, Unknown)
    ;   Unknown = Name/N
    ).

% Rules get their number in file order (which is the order of preference) and are tried by result class:
% formulas with more variables first, because rules of cost 0 turn them into those with fewer.

index_rules :-
    findall(Name-rule(Operands, Result, Cost),
            ( rule_at(Name, Operands, Result, Cost0, _, _),
              \+ off(Name),
              ( cost(Name, Cost) -> true ; Cost = Cost0 ) ),
            Rules),
    forall(nth1(Index, Rules, Name-rule(Operands, Result, Cost)),
           ( ( commutative(Name) -> Commutative = true ; Commutative = false ),
             ( implication(Name) -> Implications = 1 ; Implications = 0 ),
             assertz(grammar_rule(Index, Name, Operands, Result, Cost, Commutative, Implications)) )).

% A law is used only while all its rules are: what it drops must be made elsewhere.

index_laws :-
    forall(( law_at(Name, Left, Right, _, _),
             \+ off(Name),
             \+ ( member(Side, [Left, Right]), uses_off(Side) ),
             Left =.. [Rule|Patterns0],
             ordered(Rule, Patterns0, Patterns) ),
           ( pattern_rules(Patterns, RuleA, RuleB),
             assertz(rule_law(Rule, RuleA, RuleB, Patterns)) )).

uses_off(Term) :-
    compound(Term),
    (   functor(Term, Name, _),
        off(Name)
    ;   arg(_, Term, Argument),
        uses_off(Argument)
    ),
    !.

ordered(_, Patterns, Patterns).
ordered(Rule, [A,B], [B,A]) :-
    commutative(Rule),
    \+ [A,B] =@= [B,A].

pattern_rules([A], RuleA, -) :- pattern_rule(A, RuleA).
pattern_rules([A,B], RuleA, RuleB) :- pattern_rule(A, RuleA), pattern_rule(B, RuleB).

pattern_rule(Pattern, _) :- var(Pattern), !.
pattern_rule(Pattern, Rule) :- functor(Pattern, Rule, _).

%!  pruning(+What) is semidet.
%
%   What (`uniqueness`) has not been switched off.

pruning(What) :-
    \+ off(What).

%!  rule_failed(+Rule, +OperandClasses, +ResultClass) is det.
%
%   @error grammar_error(File, Line, Message)

rule_failed(Name, Operands, Result) :-
    rule_at(Name, _, _, _, File, Line),
    grammar_error(File, Line, "rule `~w` has no meaning for operands ~p and result ~p: no clause of sem/5 applies",
                  [Name, Operands, Result]).

%!  grammar_error(+File, +Line, +Format, +Arguments) is det.
%
%   @error grammar_error(File, Line, Message) always

grammar_error(File, Line, Format, Arguments) :-
    format(string(Message), Format, Arguments),
    throw(error(grammar_error(File, Line, Message), _)).
