; A robot hand at tables with trays, regions and movable things.
;
; ?o ?s objects (things and the supports they stand on)     ?g grasps: the hand relative to the object
; ?p ?w placements: an object relative to its support's frame  ?t reaches: the arm's approach to a placement
; ?q base poses: where the robot stands                      ?d drives: ways of the base
;
; Poses on fixed supports and on stacked blocks are given in the world; poses on a tray in the tray's frame, so
; that what stands on a tray travels with it and AtPose stays true.
; The order of the actions is the order in which demonstrations prefer equally good steps.

(define (domain tabletop)
  (:requirements :strips :equality :negative-preconditions :existential-preconditions :derived-predicates)

  (:predicates
    ; what things are: movable, or a surface that never moves
    (Movable ?o) (Surface ?o) (Block ?o) (Tray ?o) (Mug ?o) (Table ?o) (Region ?o) (Red ?o) (Green ?o) (Blue ?o)
    (Fixed ?s ?p)              ; support ?s always stands at ?p
    (Stackable ?o ?s)          ; ?o may be put on ?s
    ; certified by streams
    (Grasp ?o ?g)
    (Stand ?s ?w)              ; ?w is a place where ?s can stand
    (Pose ?o ?p ?s)            ; ?p is a placement of ?o on ?s
    (Traj ?t)
    (Base ?q)                  ; the robot's base can stand at ?q
    (Beside ?q ?s)             ; there it faces support ?s
    (Reach ?o ?p ?w ?g ?q ?t)  ; from ?q, ?t grasps ?o, placed at ?p on a support that stands at ?w, with ?g
    (Drive ?q ?q2 ?d)          ; ?d leads from ?q to ?q2 with an empty hand
    (Carry ?o ?g ?q ?q2 ?d)    ; ?d leads from ?q to ?q2 with ?o, held with ?g, and its load
    (CFree ?o ?p ?o2 ?p2)      ; the two placements do not overlap (an object's own place is taken, too)
    (ReachCFree ?t ?o2 ?p2)    ; ?t does not touch ?o2 at ?p2
    ; what changes
    (HandEmpty) (AtPose ?o ?p) (AtGrasp ?o ?g) (AtBase ?q)
    ; what follows
    (Holding ?o) (On ?o ?s) (StandsAt ?s ?w) (Unsafe ?o ?p) (Blocked ?t))

  (:action place
    :parameters (?o ?p ?s ?w ?g ?q ?t)
    :precondition (and (AtGrasp ?o ?g) (AtBase ?q) (Pose ?o ?p ?s) (StandsAt ?s ?w) (not (Unsafe ?o ?p))
                       (Reach ?o ?p ?w ?g ?q ?t) (not (Blocked ?t)))
    :effect (and (AtPose ?o ?p) (HandEmpty) (not (AtGrasp ?o ?g))))

  (:action pick
    :parameters (?o ?p ?s ?w ?g ?q ?t)
    :precondition (and (HandEmpty) (AtBase ?q) (AtPose ?o ?p) (Pose ?o ?p ?s) (StandsAt ?s ?w)
                       (Grasp ?o ?g) (Reach ?o ?p ?w ?g ?q ?t) (not (Blocked ?t)))
    :effect (and (AtGrasp ?o ?g) (not (AtPose ?o ?p)) (not (HandEmpty))))

  ; Nothing is carried loose from one place to another: the robot drives with a tray or with an empty hand.
  (:action carry
    :parameters (?o ?g ?q ?q2 ?d)
    :precondition (and (AtGrasp ?o ?g) (AtBase ?q) (Base ?q2) (Carry ?o ?g ?q ?q2 ?d))
    :effect (and (AtBase ?q2) (not (AtBase ?q))))

  (:action move
    :parameters (?q ?q2 ?d)
    :precondition (and (HandEmpty) (AtBase ?q) (Base ?q2) (Drive ?q ?q2 ?d))
    :effect (and (AtBase ?q2) (not (AtBase ?q))))

  (:derived (Holding ?o) (exists (?g) (AtGrasp ?o ?g)))
  (:derived (On ?o ?s) (exists (?p) (and (AtPose ?o ?p) (Pose ?o ?p ?s))))
  (:derived (StandsAt ?s ?w) (or (AtPose ?s ?w) (Fixed ?s ?w)))
  (:derived (Unsafe ?o ?p)
    (exists (?s ?o2 ?p2) (and (Pose ?o ?p ?s) (AtPose ?o2 ?p2) (not (CFree ?o ?p ?o2 ?p2)))))
  (:derived (Blocked ?t)
    (exists (?o2 ?p2) (and (Traj ?t) (AtPose ?o2 ?p2) (not (ReachCFree ?t ?o2 ?p2))))))
