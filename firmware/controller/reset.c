#include "firmware/controller/reset.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/wdt.h>

#include "firmware/controller/lights.h"
#include "firmware/protocol/codec.h"

#define RUNNING 0x5a7e
#define STUCK_MS 60

/* These outlive a reset, but not a power cut. */
static uint8_t boot_mcusr __attribute__((section(".noinit")));
static uint8_t boot_r2 __attribute__((section(".noinit")));
static uint16_t running __attribute__((section(".noinit")));
static volatile uint8_t stuck_ms __attribute__((section(".noinit")));

/* The first code of ours, before RAM is set up: outputs off, then the watchdog, which stays on over
 * its own reset with its shortest time. A wild jump to 0 comes by here too, hence cli. */
void BeforeMain(void) __attribute__((naked, used, section(".init3")));
void BeforeMain(void) {
  cli();
  LightsPinsOff();
  __asm__ __volatile__("sts %0, r2" ::"i"(&boot_r2));
  boot_mcusr = MCUSR;
  MCUSR = 0;
  wdt_disable();
}

/* Returns the cause of the reset by the best evidence that is left. Optiboot leaves the flags in r2
 * from version 4.6 on, and nothing before. A bootloader that clears MCUSR ends by its own watchdog. So a
 * watchdog flag in r2 may only mean that the reset line was pulled, and whether the main loop had
 * been stuck decides. A hang with interrupts off behind such a bootloader stays unknown. */
static uint8_t Cause(void) {
  const uint8_t known = 0x0f;
  if (boot_mcusr & known) {
    return boot_mcusr & known;
  }
  if (running != RUNNING) {
    return SATEEN_RESET_POWER_ON;
  }
  if (stuck_ms >= STUCK_MS) {
    return SATEEN_RESET_WATCHDOG;
  }
  if ((boot_r2 & ~known) == 0 && (boot_r2 & SATEEN_RESET_WATCHDOG) == 0) {
    return boot_r2;
  }
  return 0;
}

uint8_t ResetCause(void) {
  static uint8_t cause;
  static uint8_t asked;
  if (!asked) {
    asked = 1;
    cause = Cause();
    running = RUNNING;
    stuck_ms = 0;
  }
  return cause;
}

void ResetNoteTick(void) {
  if (stuck_ms < STUCK_MS) {
    ++stuck_ms;
  }
}

void ResetNoteLoop(void) { stuck_ms = 0; }
