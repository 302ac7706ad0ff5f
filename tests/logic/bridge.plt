:- use_module(library(plunit)).
:- use_module(cup_pool).
:- use_module('../../logic/bridge').

:- begin_tests(bridge).

test(answer, [forall(member(Goal-Status-Output,
         [ 'write(hello)'-true-"hello",
           'write(before), fail'-false-_,
           'throw(error(resource_error(memory), _))'-limit-"not enough memory",
           'throw(error(grammar_error(''g.lp'', 3, "wrong"), _))'-input-"g.lp\t3\t0\twrong",
           'throw(error(notation_error(5, "wrong"), _))'-input-"\t0\t5\twrong" ])),
               true(S-O = Status-Output)]) :-
    answer(Goal, S, O).

test(errors_are_one_line, [true(sub_string(Line, _, _, _, "no_such_goal/1")), nondet]) :-
    answer('no_such_goal(1)', error, Output),
    split_string(Output, "\n", "", [Line]).

% Newer versions of plunit refuse tests with warnings that end the program with an error, collected or not.
test(load_report, [setup(set_prolog_flag(on_error, print)), cleanup(set_prolog_flag(on_error, status)),
                   true(Found == [2]), nondet]) :-
    text_file("good(1).\nbad(.\n", File),
    load_report(File, Lines),
    split_string(Lines, "\n", "", Rows),
    findall(Line, ( member(Row, Rows), split_string(Row, "\t", "", [_,L,_|_]), number_string(Line, L) ), Found0),
    sort(Found0, Found).

test(to_file, Text == "∃\n") :-
    text_file("", File),
    to_file(File, writeln('∃')),
    setup_call_cleanup(open(File, read, In, [encoding(utf8)]), read_string(In, _, Text), close(In)).

:- end_tests(bridge).
