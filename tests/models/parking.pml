/* Sleeping and waking as in engine/parking.hpp: one consumer, two producers. Shown: no wake-up is lost, that is, the
 * consumer never sleeps for ever while a message waits (which would be an invalid end state).
 *
 * Seeded faults: FAULT_NO_RECHECK  the consumer does not look again between announcement and sleep
 *                FAULT_NO_COUNT    a wake does not change the word the futex compares
 */
#define PRODUCERS 2
#define MESSAGES 2

byte queue[PRODUCERS];
byte wakes;       /* count in the futex word */
bool sleeping;    /* bit 0 of it */
bool asleep;      /* the consumer is inside the futex call */
byte received;

proctype producer(byte me) {
  byte sent;
  bool seen;
  do
  :: sent < MESSAGES ->
     queue[me]++;
     atomic {  /* fetch_add */
#ifndef FAULT_NO_COUNT
       wakes++;
#endif
       seen = sleeping
     };
     if
     :: seen -> asleep = false  /* futex wake; nothing happens when nobody sleeps */
     :: else
     fi;
     sent++
  :: else -> break
  od
}

inline pop() {
  if
  :: atomic { queue[0] > 0 -> queue[0]--; received++ }
  :: atomic { queue[0] == 0 && queue[1] > 0 -> queue[1]--; received++ }
  :: atomic { queue[0] == 0 && queue[1] == 0 -> nothing = true }
  fi
}

proctype consumer() {
  byte expected;
  bool nothing;
  do
  :: received < PRODUCERS * MESSAGES ->
     nothing = false;
     pop();
     if
     :: nothing ->
        atomic { sleeping = true; expected = wakes };  /* fetch_or */
#ifndef FAULT_NO_RECHECK
        nothing = false;
        pop();
#endif
        if
        :: nothing ->
           atomic {  /* futex wait: compares and falls asleep in one step */
             if
             :: wakes == expected && sleeping -> asleep = true
             :: else
             fi
           };
           !asleep
        :: else
        fi;
        sleeping = false
     :: else
     fi
  :: else -> break
  od
}

init {
  atomic { run producer(0); run producer(1); run consumer() }
}
