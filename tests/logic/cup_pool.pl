:- module(cup_pool,
          [ open_cup/0,
            cup_file/1,             % -File
            grammar_file/1,         % -File
            text_file/2             % +Text, -File
          ]).
:- use_module('../../logic/pool', [pool_grammar/1, pool_level/1, pool_open/1]).

% What the tests of the pool's parts have in common: the data of cup.pl and their pool up to cost 3.

:- dynamic here/1.
:- prolog_load_context(directory, Here), assertz(here(Here)).

cup_file(File) :- here(Here), atom_concat(Here, '/cup.pl', File).

grammar_file(File) :- here(Here), atom_concat(Here, '/../../logic/grammar.lp', File).

open_cup :-
    grammar_file(Grammar),
    cup_file(Cup),
    with_output_to(string(""), pool_grammar([Grammar])),
    pool_open(Cup),
    forall(between(0, 3, Cost), pool_level(Cost)).

% text_file(+Text, -File): File is new and holds Text.

text_file(Text, File) :-
    tmp_file_stream(File, Out, [encoding(utf8)]),
    write(Out, Text),
    close(Out).
