/* Sleeping and waking as in engine/parking.hpp: one consumer, two producers, somebody who requests a stop. Shown: no
 * wake-up is lost, that is, when nothing moves any more the consumer is not asleep with a message waiting or the stop
 * requested; and whatever ends a wait, a message, its deadline or the stop, it takes the announcement back.
 *
 * Messages and the stop may come or not. Deadlines pass a bounded number of times, at any moment: more of them would wake
 * a consumer that was forgotten.
 *
 * Seeded faults: FAULT_NO_RECHECK    the consumer does not look again between announcement and sleep
 *                FAULT_NO_COUNT      a wake does not change the word the futex compares
 *                FAULT_STOP_SILENT   the request to stop wakes nobody
 *                FAULT_STOP_UNSEEN   the consumer does not look for the request between announcement and sleep
 *                FAULT_KEEP_BIT      a wait that its deadline ends leaves its announcement behind
 */
#define PRODUCERS 2
#define MESSAGES 2
#define DEADLINES 2

byte queue[PRODUCERS];
byte wakes;        /* count in the futex word */
bool sleeping;     /* bit 0 of it */
bool asleep;       /* the consumer is inside the futex call */
byte received;
byte deadlines;    /* that have passed */
bool stop;
bool registered;   /* the consumer's callback: whoever requests the stop from now on wakes it */

inline wake(seen) {
  atomic {  /* fetch_add */
#ifndef FAULT_NO_COUNT
    wakes++;
#endif
    seen = sleeping
  };
  if
  :: seen -> asleep = false  /* futex wake; nothing happens when nobody sleeps */
  :: else
  fi
}

proctype producer(byte me) {
  byte sent;
  bool seen;
  do
  :: sent < MESSAGES ->
     queue[me]++;
     wake(seen);
     sent++
  :: break
  od
}

proctype stopper() {
  bool seen, calls;
  if
  :: goto unwanted
  :: skip
  fi;
  atomic { stop = true; calls = registered };
#ifndef FAULT_STOP_SILENT
  if
  :: calls -> wake(seen)
  :: else
  fi;
#endif
unwanted: skip
}

inline pop() {
  nothing = false;
  if
  :: atomic { queue[0] > 0 -> queue[0]--; received++ }
  :: atomic { queue[0] == 0 && queue[1] > 0 -> queue[1]--; received++ }
  :: atomic { queue[0] == 0 && queue[1] == 0 -> nothing = true }
  fi
}

inline sleep() {
  atomic {  /* futex wait: compares and falls asleep in one step */
    if
    :: wakes == expected && sleeping -> asleep = true
    :: else
    fi
  };
end_asleep:
  if
  :: !asleep
  :: atomic { asleep && deadlines < DEADLINES -> deadlines++; asleep = false }
  fi
}

inline wait() {
  pop();
  if
  :: nothing ->
     atomic { registered = true; self = stop };
     if
     :: self -> wake(seen)  /* the callback is called at once */
     :: else
     fi;
     do
     :: atomic { sleeping = true; expected = wakes };  /* fetch_or */
#ifndef FAULT_NO_RECHECK
        pop();
#endif
        if
#ifdef FAULT_STOP_UNSEEN
        :: nothing ->
#else
        :: nothing && !stop ->
#endif
           if
           :: atomic { deadlines < DEADLINES -> deadlines++ };
#ifndef FAULT_KEEP_BIT
              sleeping = false;
#endif
              break
           :: sleep();
              sleeping = false;
              pop();
              if
              :: nothing && !stop
              :: else -> break
              fi
           fi
        :: else -> sleeping = false; break
        fi
     od;
     registered = false
  :: else
  fi
}

proctype consumer() {
  byte expected;
  bool nothing, seen, self;
  do
  :: received < PRODUCERS * MESSAGES ->
     wait();
     assert(!sleeping);
     if
     :: nothing && stop -> break
     :: else
     fi
  :: else -> break
  od
}

/* When nobody else can go on. */
proctype watcher() {
  timeout;
  assert(!asleep || (!stop && queue[0] == 0 && queue[1] == 0))
}

init {
  atomic { run producer(0); run producer(1); run stopper(); run consumer(); run watcher() }
}
