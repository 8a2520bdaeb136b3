/* Hand-over and reclamation of snapshots: one writer, two readers, one mailbox a reader; the protocol of
 * engine/snapshot_mailbox.hpp. Orders of memory are not modelled here (see relacy_mailbox.cpp): each statement is one
 * atomic access, and all interleavings are searched.
 *
 * Shown: a reader never reads a version whose room was given back (no use after free); room for a new version is
 * always there, so that never more than 2 N + 2 live; after collect at most 2 N + 1 live; when the readers have the
 * newest version all others are reclaimed (no leak); nobody waits for ever (no invalid end state).
 *
 * Seeded faults, each of which must be found:
 *   FAULT_ANNOUNCE_EARLY   the reader announces what it saw in the box while it still reads the older version
 *   FAULT_FREE_HELD        the writer frees versions up to and including the announced one
 *   FAULT_KEEP_RETURNED    the writer forgets to release what put handed back
 *   FAULT_SMALL            room for one version less than the bound
 */
#define READERS 2
#define VERSIONS 6
#ifdef FAULT_SMALL
#define ROOMS (2 * READERS + 1)
#else
#define ROOMS (2 * READERS + 2)
#endif
#define NONE 255

byte box[READERS];       /* room of the version in the mailbox, NONE when taken */
byte announced[READERS]; /* newest version the reader said it holds */
byte version[ROOMS];     /* version in a room, 0 = free */
byte users[ROOMS];       /* writer's book: set of readers that may still come to it */
byte done;               /* readers that have the last version */

inline leave(room, reader) {
  users[room] = users[room] & (3 - (1 << reader))
}

inline collect() {
  r = 0;
  do
  :: r < READERS ->
     held = announced[r];
     d_step {  /* the writer's own books */
       i = 0;
       do
       :: i < ROOMS ->
          if
#ifdef FAULT_FREE_HELD
          :: version[i] != 0 && version[i] <= held && version[i] < next && version[i] < VERSIONS -> leave(i, r)
#else
          :: version[i] != 0 && version[i] < held -> leave(i, r)
#endif
          :: else
          fi;
          i++
       :: else -> break
       od
     };
     r++
  :: else -> break
  od;
  skip;
  d_step {
    live = 0; i = 0;
    do
    :: i < ROOMS ->
       if
       :: users[i] == 0 -> version[i] = 0
       :: else
       fi;
       live = live + (version[i] != 0);
       i++
    :: else -> break
    od
  }
}

proctype writer() {
  byte next = 2, room, old, r, i, held, live;
  do
  :: next <= VERSIONS ->
     d_step {
       room = 0;
       do
       :: room < ROOMS && version[room] != 0 -> room++
       :: else -> break
       od;
       assert(room < ROOMS);  /* the bound */
       version[room] = next;
       users[room] = 3
     };
     r = 0;
     do
     :: r < READERS ->
        atomic { old = box[r]; box[r] = room };  /* put */
        if
#ifdef FAULT_KEEP_RETURNED
        :: false
#else
        :: old != NONE -> d_step { leave(old, r) }
#endif
        :: else
        fi;
        r++
     :: else -> break
     od;
     collect();
     assert(live <= 2 * READERS + 1);
     next++
  :: else -> break
  od;
  done == READERS;
  collect();
  assert(live == 1)
}

proctype reader(byte me) {
  byte room = NONE, last = 0;
  do
  :: last < VERSIONS ->
     if
     :: box[me] != NONE ->
#ifdef FAULT_ANNOUNCE_EARLY
        announced[me] = version[box[me]];
        if
        :: room != NONE -> assert(version[room] == last)  /* it still reads the old one */
        :: else
        fi;
#endif
        atomic { room = box[me]; box[me] = NONE };  /* latest: take, ... */
        assert(version[room] > last);
        last = version[room];
#ifndef FAULT_ANNOUNCE_EARLY
        announced[me] = last  /* ... then announce */
#endif
     :: room != NONE && version[room] != last -> assert(false)  /* use after free */
     fi
  :: else -> break
  od;
  assert(version[room] == last);
  atomic { done++ }
}

init {
  atomic {
    version[0] = 1;
    users[0] = 3;
    run writer();
    run reader(0);
    run reader(1)
  }
}
