#ifndef SATEEN_FIRMWARE_CONTROLLER_SETTINGS_H_
#define SATEEN_FIRMWARE_CONTROLLER_SETTINGS_H_

/* Settings that the EEPROM keeps. A record lies at SETTINGS_ADDRESS with a CRC-16 behind it (low byte first).
 * Blank EEPROM gives the defaults of a new board; a damaged record gives limits that are safe for any
 * LED, and a fault. */

#include <stdint.h>

#include "firmware/controller/pins.h"

/* Not 0: a write that a brown-out misdirects hits that address first. */
#define SETTINGS_ADDRESS 16
#define SETTINGS_MARK 0x53
#define SETTINGS_VERSION 1

typedef struct Settings {
  uint8_t mark;
  uint8_t version;
  uint8_t max_lit;
  uint8_t dim_clock;
  uint8_t sync_edge;
  uint16_t max_level_permille[SATEEN_CHANNELS];
  uint16_t max_on_ms[SATEEN_CHANNELS];
} Settings;

/* In force now. The timer interrupt reads it: change it with all lights off. */
extern Settings settings;

/* Returns 0 where the record is damaged. */
uint8_t SettingsLoad(void);
/* Writes the bytes that have changed, 3.4 ms per byte. Returns 0 where the EEPROM does not read back the same. */
uint8_t SettingsStore(void);

#endif
