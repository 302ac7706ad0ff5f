; A slippery gripper: what it picks may slip and stay where it is, any number of times. A push always works, but only
; to a free place on the right.

(define (domain slippery)
  (:requirements :strips :typing :negative-preconditions :non-deterministic)
  (:types block place)
  (:predicates (at ?b - block ?p - place) (holding ?b - block) (empty) (next ?p ?q - place) (full ?p - place))

  (:action pick
    :parameters (?b - block ?p - place)
    :precondition (and (at ?b ?p) (empty))
    :effect (oneof
      (and (holding ?b) (not (empty)) (not (at ?b ?p)) (not (full ?p)))
      (and)))

  (:action place
    :parameters (?b - block ?p - place)
    :precondition (and (holding ?b) (not (full ?p)))
    :effect (and (at ?b ?p) (full ?p) (empty) (not (holding ?b))))

  (:action push
    :parameters (?b - block ?p ?q - place)
    :precondition (and (at ?b ?p) (next ?p ?q) (not (full ?q)))
    :effect (and (at ?b ?q) (full ?q) (not (at ?b ?p)) (not (full ?p)))))

(define (problem swap)
  (:domain slippery)
  (:objects a b - block  left middle right - place)
  (:init (empty) (at a left) (full left) (at b middle) (full middle) (next left middle) (next middle right))
  (:goal (and (at a middle) (at b left))))
