/* The LED board's firmware, for an ATmega328P at 16 MHz. What it guards, and where:
 *
 *     outputs off first at every start                    reset.c, before RAM is set up
 *     max level, lights at a time                         lights.c, before a light goes on
 *     max on-time, silence of the host                    lights.c, in the timer's interrupt
 *     a main loop that hangs                              hardware watchdog, 120 ms
 *     frames that are not good, repeated, or of a host that missed a restart      link.c
 */
#include <avr/interrupt.h>
#include <avr/sleep.h>
#include <avr/wdt.h>

#include "firmware/controller/lights.h"
#include "firmware/controller/link.h"
#include "firmware/controller/reset.h"
#include "firmware/controller/settings.h"
#include "firmware/controller/uart.h"

static void RaiseFaultOfReset(void) {
  const uint8_t cause = ResetCause();
  if (cause & SATEEN_RESET_WATCHDOG) {
    LightsFault(SATEEN_FAULT_WATCHDOG);
  } else if ((cause & (SATEEN_RESET_BROWN_OUT | SATEEN_RESET_POWER_ON)) ==
             SATEEN_RESET_BROWN_OUT) { /* power that comes up slowly is both, and no fault */
    LightsFault(SATEEN_FAULT_BROWN_OUT);
  }
}

/* Sleeps until a byte, a fault or the next millisecond. An interrupt between the test and the sleep
 * wakes it, because sei takes effect after the next instruction. */
static void SleepIfIdle(void) {
  cli();
  if (!UartWaiting() && !LightsFaultWaiting()) {
    sleep_enable();
    sei();
    sleep_cpu();
    sleep_disable();
  }
  sei();
}

int main(void) {
  const uint8_t loaded = SettingsLoad();
  wdt_enable(WDTO_120MS);
  UartInit();
  LightsInit();
  RaiseFaultOfReset();
  if (!loaded) {
    LightsFault(SATEEN_FAULT_LIMITS_LOST);
  }
  set_sleep_mode(SLEEP_MODE_IDLE);
  sei();
  LinkStart();
  for (;;) {
    uint8_t byte;
    wdt_reset();
    ResetNoteLoop();
    if (LightsFaultWaiting()) {
      LinkAnnounceFault();
    }
    /* Not for ever, or a flood of bytes would starve the watchdog. */
    for (uint8_t i = 0; i < 64 && UartTake(&byte); ++i) {
      LinkReceive(byte);
    }
    SleepIfIdle();
  }
}
