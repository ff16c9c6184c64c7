#ifndef SATEEN_FIRMWARE_CONTROLLER_LIGHTS_H_
#define SATEEN_FIRMWARE_CONTROLLER_LIGHTS_H_

/* All outputs, and the clock that turns them off. The limits are enforced in the timer's interrupt,
 * so that a light goes off in time whatever the main loop does.
 *
 * A light that is told to be on for n ms is on for more than n - 1 and at most n ms.
 *
 * Functions that return uint8_t return a SateenResult; other than DONE, nothing has changed. */

#include <stdint.h>

#include "firmware/controller/pins.h"
#include "firmware/protocol/codec.h"

/* All outputs low, PWM off. Needs neither stack nor RAM: the first thing that runs. */
static inline void LightsPinsOff(void) __attribute__((always_inline));

/* Starts the clock and the flash-sync input; interrupts are still off. */
void LightsInit(void);

uint8_t LightsSet(const SateenSetLight* command);
uint8_t LightsArm(const SateenArm* command);
uint8_t LightsTriggerShutter(const SateenTriggerShutter* command);
/* Disarms and opens the shutter output too. */
void LightsAllOff(void);
/* All off, and a host has been told of the fault that stands. */
void LightsHello(void);
/* After a change of the settings, with all off. */
void LightsUseSettings(void);

/* A good frame has come from the host. */
void LightsHostHeard(void);
/* Everything of the state but `request` and `result`. */
void LightsState(SateenState* state);
/* Time and counters of the report. */
void LightsReport(SateenReport* report);

/* Turns everything off, remembers the fault and announces it. */
void LightsFault(uint8_t fault);
void LightsClearFault(uint8_t fault);
/* Whether a fault waits to be announced, with interrupts off; and takes it. */
uint8_t LightsFaultWaiting(void);
void LightsTakeFault(SateenFault* fault);

/* ---- */
#include <avr/io.h>
static inline void LightsPinsOff(void) {
  TCCR1A = 0;
  TCCR1B = 0;
  TIMSK0 = 0;
  EIMSK = 0;
  PORTB = 0;
  PORTC = 0;
  PORTD = 0;
  /* D0 (receive) stays an input, and D2 where it is the flash sync; D1 belongs to the UART. */
  DDRB = 0x3f;
  DDRC = 0x3f;
  DDRD = SATEEN_LIGHTS == 16 ? 0xfc : 0xf8;
}

#endif
