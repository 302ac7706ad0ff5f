(define (stream tabletop)

  ; Hand poses that close on two opposite sides of the object.
  (:stream sample-grasp
    :inputs (?o) :domain (Movable ?o)
    :outputs (?g) :certified (Grasp ?o ?g))

  ; Stable placements: uniform on tables and regions, in the cells of a tray one after the other.
  (:stream sample-placement
    :inputs (?o ?s) :domain (and (Movable ?o) (Surface ?s) (Stackable ?o ?s))
    :outputs (?p) :certified (and (Pose ?o ?p ?s) (Stand ?o ?p)))

  (:stream sample-cell
    :inputs (?o ?s) :domain (and (Movable ?o) (Tray ?s) (Stackable ?o ?s))
    :outputs (?p) :certified (and (Pose ?o ?p ?s) (Stand ?o ?p)))

  ; Places for a mobile robot in front of a support; none for a fixed one.
  (:stream sample-base
    :inputs (?s) :domain (Surface ?s)
    :outputs (?q) :certified (and (Base ?q) (Beside ?q ?s)))

  ; Inverse kinematics and a straight, table-clear approach.
  (:stream sample-reach
    :inputs (?o ?p ?s ?w ?g ?q) :domain (and (Pose ?o ?p ?s) (Stand ?s ?w) (Grasp ?o ?g) (Base ?q))
    :outputs (?t) :certified (and (Traj ?t) (Reach ?o ?p ?w ?g ?q ?t)))

  ; Ways of the base, clear of the tables and of what may stand on them.
  (:stream sample-drive
    :inputs (?q ?q2) :domain (and (Base ?q) (Base ?q2))
    :outputs (?d) :certified (Drive ?q ?q2 ?d))

  (:stream sample-carry
    :inputs (?o ?g ?q ?q2) :domain (and (Tray ?o) (Grasp ?o ?g) (Base ?q) (Base ?q2))
    :outputs (?d) :certified (Carry ?o ?g ?q ?q2 ?d))

  (:stream test-cfree
    :inputs (?o ?p ?o2 ?p2) :domain (and (Movable ?o) (Stand ?o ?p) (Movable ?o2) (Stand ?o2 ?p2))
    :certified (CFree ?o ?p ?o2 ?p2))

  (:stream test-reach-cfree
    :inputs (?t ?o2 ?p2) :domain (and (Traj ?t) (Movable ?o2) (Stand ?o2 ?p2))
    :certified (ReachCFree ?t ?o2 ?p2)))
