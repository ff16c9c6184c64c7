#include "firmware/controller/lights.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <util/atomic.h>

#include "firmware/controller/pins.h"
#include "firmware/controller/reset.h"
#include "firmware/controller/settings.h"

#define PORT_IS_B 1
#define PORT_IS_C 2
#define PORT_IS_D 3
#define PIN_ON(which, port, bit) ((PORT_IS_##port) == (which) ? 1u << (bit) : 0u)
#define PIN_B(channel, port, bit, name) | PIN_ON(1, port, bit)
#define PIN_C(channel, port, bit, name) | PIN_ON(2, port, bit)
#define PIN_D(channel, port, bit, name) | PIN_ON(3, port, bit)
enum {
  kLightsOnB = 0 SATEEN_LIGHT_PINS(PIN_B),
  kLightsOnC = 0 SATEEN_LIGHT_PINS(PIN_C),
  kLightsOnD = 0 SATEEN_LIGHT_PINS(PIN_D),
  kTop = SATEEN_FULL_LEVEL - 1
};

/* All of this is written with interrupts off. */
static uint16_t lit;
static uint16_t level_permille;
static uint16_t on_ms[SATEEN_CHANNELS];   /* since it went on */
static uint16_t left_ms[SATEEN_CHANNELS]; /* until it goes off */
static uint16_t shutter_ms;
static uint8_t armed = SATEEN_NO_CHANNEL;
static uint16_t silent_ms;
static uint32_t uptime_ms;
static uint16_t syncs;
static uint16_t flashes;
static uint8_t fault;
static uint8_t over_time; /* a light reached its limit, and the host has not said that it knows */
static uint16_t faults;
static SateenFault waiting_fault;

static void Count(uint16_t* counter) {
  if (*counter != 0xffff) {
    ++*counter;
  }
}

static void WriteEnables(uint16_t mask) {
  uint8_t bits[4] = {0, 0, 0, 0};
#define WRITE(channel, port, bit, name) \
  if (mask & (1u << (channel))) {       \
    bits[PORT_IS_##port] |= _BV(bit);   \
  }
  SATEEN_LIGHT_PINS(WRITE)
  PORTB = (uint8_t)((PORTB & ~kLightsOnB) | bits[PORT_IS_B]);
  PORTC = (uint8_t)((PORTC & ~kLightsOnC) | bits[PORT_IS_C]);
  PORTD = (uint8_t)((PORTD & ~kLightsOnD) | bits[PORT_IS_D]);
}

static void Indicate(void) {
  if (lit || armed != SATEEN_NO_CHANNEL) {
    PORTB |= _BV(SATEEN_INDICATOR_BIT);
  } else {
    PORTB &= (uint8_t)~_BV(SATEEN_INDICATOR_BIT);
  }
}

/* Normal mode, where the pin is the port's: low. */
static void DimOff(void) {
  TCCR1A = 0;
  TCCR1B = 0;
}

/* Fast PWM with TOP in ICR1 (mode 14). OCR1A takes a value at once only outside PWM modes, so it is
 * written before the mode. It is written again in the mode, which changes nothing on silicon and
 * tells a simulated timer. The count starts at TOP: the first period begins with the next
 * clock, so that every exposure sees the same phase. */
static void DimOn(uint16_t level) {
  static const uint8_t kClock[3] = {_BV(CS10), _BV(CS11), _BV(CS11) | _BV(CS10)};
  ICR1 = kTop;
  OCR1A = level - 1;
  TCNT1 = kTop;
  TCCR1A = _BV(COM1A1) | _BV(WGM11);
  TCCR1B = _BV(WGM13) | _BV(WGM12);
  OCR1A = level - 1;
  TCCR1B = (uint8_t)(_BV(WGM13) | _BV(WGM12) | kClock[settings.dim_clock]);
}

/* Dark while the enables change, unless lights only join or leave at the same level. */
static void Light(uint16_t mask, uint16_t level) {
  const uint8_t keeps = (lit & mask) != 0 && level == level_permille;
  if (mask == 0) {
    level = 0;
  }
  if (!keeps) {
    DimOff();
  }
  WriteEnables(mask);
  if (mask != 0 && !keeps) {
    DimOn(level);
  }
  lit = mask;
  level_permille = level;
  Indicate();
}

static void TurnOn(uint8_t channel, uint16_t level, uint16_t time_ms, uint16_t others) {
  const uint16_t bit = 1u << channel;
  if (!(lit & bit)) {
    on_ms[channel] = 0;
  }
  left_ms[channel] = time_ms;
  Light(others | bit, level);
}

#if SATEEN_LIGHTS == 14
static uint16_t armed_level_permille;
static uint16_t armed_on_ms;

static void OpenShutter(void) {
  PORTC &= (uint8_t)~_BV(SATEEN_SHUTTER_BIT);
  shutter_ms = 0;
}
#else
static void OpenShutter(void) {}
#endif

static void EverythingOff(void) {
  armed = SATEEN_NO_CHANNEL;
  Light(0, 0);
  OpenShutter();
}

static void RaiseFault(uint8_t number) {
  waiting_fault.fault = number;
  waiting_fault.lit = lit;
  fault = number;
  Count(&faults);
  EverythingOff();
}

static void TickLights(void) {
  uint16_t mask = lit;
  uint16_t bit = 1;
  uint8_t over_limit = 0;
  /* The bit walks along, for an AVR shifts by a variable slowly. */
  for (uint8_t channel = 0; channel < SATEEN_CHANNELS; ++channel, bit <<= 1) {
    if (!(lit & bit)) {
      continue;
    }
    ++on_ms[channel];
    --left_ms[channel];
    if (left_ms[channel] == 0) {
      mask &= ~bit;
    } else if (on_ms[channel] >= settings.max_on_ms[channel]) {
      over_limit = 1;
    }
  }
  if (over_limit) {
    RaiseFault(SATEEN_FAULT_ON_TIME_LIMIT);
    over_time = 1;
  } else if (mask != lit) {
    Light(mask, level_permille);
  }
}

ISR(TIMER0_COMPA_vect) {
  ++uptime_ms;
  ResetNoteTick();
  if (lit) {
    TickLights();
  }
  if (shutter_ms != 0 && --shutter_ms == 0) {
    OpenShutter();
  }
  if (silent_ms < SATEEN_SILENCE_MS && ++silent_ms == SATEEN_SILENCE_MS &&
      (lit || shutter_ms || armed != SATEEN_NO_CHANNEL)) {
    RaiseFault(SATEEN_FAULT_HOST_SILENT);
  }
}

#if SATEEN_LIGHTS == 14
/* The camera's flash sync. */
ISR(INT0_vect) {
  Count(&syncs);
  if (armed != SATEEN_NO_CHANNEL) {
    const uint8_t channel = armed;
    armed = SATEEN_NO_CHANNEL;
    TurnOn(channel, armed_level_permille, armed_on_ms, 0);
    Count(&flashes);
  }
}

void LightsUseSettings(void) {
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
    EIMSK = 0;
    EICRA = settings.sync_edge ? _BV(ISC01) | _BV(ISC00) : _BV(ISC01);
    EIFR = _BV(INTF0);
    EIMSK = _BV(INT0);
  }
}
#else
void LightsUseSettings(void) {}
#endif

void LightsInit(void) {
#if SATEEN_LIGHTS == 14
  PORTD |= _BV(SATEEN_SYNC_BIT); /* its pull-up */
#endif
  TCCR0A = _BV(WGM01);
  TCCR0B = _BV(CS01) | _BV(CS00);
  OCR0A = F_CPU / 64 / 1000 - 1;
  TIMSK0 = _BV(OCIE0A);
  LightsUseSettings();
}

/* Turning off is always allowed. */
static uint8_t Allowed(uint8_t channel, uint16_t level, uint16_t time_ms) {
  if (channel >= SATEEN_CHANNELS || level > SATEEN_FULL_LEVEL || (level > 0 && time_ms == 0)) {
    return SATEEN_RESULT_OUT_OF_RANGE;
  }
  if (level == 0) {
    return SATEEN_RESULT_DONE;
  }
  if (over_time || level > settings.max_level_permille[channel] ||
      time_ms > settings.max_on_ms[channel]) {
    return SATEEN_RESULT_OVER_LIMIT;
  }
  return SATEEN_RESULT_DONE;
}

static uint8_t CountLit(uint16_t mask) {
  uint8_t count = 0;
  for (; mask != 0; mask &= mask - 1) {
    ++count;
  }
  return count;
}

/* Interrupts are off. */
static uint8_t Set(const SateenSetLight* command) {
  const uint16_t bit = 1u << command->channel;
  const uint16_t others = command->add ? lit & ~bit : 0;
  if (command->level_permille == 0) {
    Light(others, level_permille);
    armed = SATEEN_NO_CHANNEL;
    Indicate();
    return SATEEN_RESULT_DONE;
  }
  if (others != 0 && command->level_permille != level_permille) {
    return SATEEN_RESULT_OTHER_LEVEL;
  }
  if (CountLit(others) >= settings.max_lit) {
    return SATEEN_RESULT_TOO_MANY_LIT;
  }
  armed = SATEEN_NO_CHANNEL;
  TurnOn(command->channel, command->level_permille, command->on_ms, others);
  return SATEEN_RESULT_DONE;
}

uint8_t LightsSet(const SateenSetLight* command) {
  uint8_t result = Allowed(command->channel, command->level_permille, command->on_ms);
  if (command->add > 1) {
    result = SATEEN_RESULT_OUT_OF_RANGE;
  }
  if (result == SATEEN_RESULT_DONE) {
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) { result = Set(command); }
  }
  return result;
}

#if SATEEN_LIGHTS == 14
uint8_t LightsArm(const SateenArm* command) {
  const uint8_t result = Allowed(command->channel, command->level_permille, command->on_ms);
  if (result == SATEEN_RESULT_DONE && command->level_permille == 0) {
    return SATEEN_RESULT_OUT_OF_RANGE;
  }
  if (result == SATEEN_RESULT_DONE) {
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
      Light(0, 0);
      armed = command->channel;
      armed_level_permille = command->level_permille;
      armed_on_ms = command->on_ms;
      Indicate();
    }
  }
  return result;
}

uint8_t LightsTriggerShutter(const SateenTriggerShutter* command) {
  if (command->press_ms == 0 || command->press_ms > SATEEN_LONGEST_PRESS_MS) {
    return SATEEN_RESULT_OUT_OF_RANGE;
  }
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
    shutter_ms = command->press_ms;
    PORTC |= _BV(SATEEN_SHUTTER_BIT);
  }
  return SATEEN_RESULT_DONE;
}
#else
uint8_t LightsArm(const SateenArm* command) {
  (void)command;
  return SATEEN_RESULT_UNKNOWN_MESSAGE;
}

uint8_t LightsTriggerShutter(const SateenTriggerShutter* command) {
  (void)command;
  return SATEEN_RESULT_UNKNOWN_MESSAGE;
}
#endif

void LightsAllOff(void) {
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) { EverythingOff(); }
}

void LightsHostHeard(void) {
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) { silent_ms = 0; }
}

void LightsFault(uint8_t number) {
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) { RaiseFault(number); }
}

void LightsClearFault(uint8_t number) {
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
    if (fault == number) {
      fault = SATEEN_FAULT_NONE;
    }
    if (number == SATEEN_FAULT_ON_TIME_LIMIT) {
      over_time = 0;
    }
  }
}

void LightsHello(void) {
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
    EverythingOff();
    over_time = 0;
  }
}

uint8_t LightsFaultWaiting(void) { return waiting_fault.fault != SATEEN_FAULT_NONE; }

void LightsTakeFault(SateenFault* taken) {
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
    *taken = waiting_fault;
    waiting_fault.fault = SATEEN_FAULT_NONE;
  }
}

/* With interrupts off, so that the values belong together. */
static void Snapshot(SateenState* state) {
  uint16_t bit = 1;
  state->fault = fault;
  state->lit = lit;
  state->level_permille = level_permille;
  state->lit_ms = 0;
  state->left_ms = lit ? 0xffff : 0;
  for (uint8_t channel = 0; channel < SATEEN_CHANNELS; ++channel, bit <<= 1) {
    if (lit & bit) {
      if (on_ms[channel] > state->lit_ms) {
        state->lit_ms = on_ms[channel];
      }
      if (left_ms[channel] < state->left_ms) {
        state->left_ms = left_ms[channel];
      }
    }
  }
  state->armed = armed;
  state->shutter_ms = shutter_ms;
}

void LightsState(SateenState* state) {
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) { Snapshot(state); }
}

void LightsReport(SateenReport* report) {
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
    report->uptime_ms = uptime_ms;
    report->syncs = syncs;
    report->flashes = flashes;
    report->faults = faults;
  }
}
