#include "firmware/controller/settings.h"

#include <avr/eeprom.h>
#include <avr/wdt.h>

#include "firmware/protocol/codec.h"
#include "firmware/protocol/frame.h"

#define NEW_ON_MS 10000
#define SAFE_LEVEL 100
#define SAFE_ON_MS 1000

Settings settings;

static void SetAll(uint16_t max_level_permille, uint16_t max_on_ms) {
  settings.mark = SETTINGS_MARK;
  settings.version = SETTINGS_VERSION;
  settings.max_lit = 1;
  settings.dim_clock = 0;
  settings.sync_edge = 0;
  for (uint8_t channel = 0; channel < SATEEN_CHANNELS; ++channel) {
    settings.max_level_permille[channel] = max_level_permille;
    settings.max_on_ms[channel] = max_on_ms;
  }
}

static uint8_t* At(uint8_t offset) { return (uint8_t*)(uintptr_t)(SETTINGS_ADDRESS + offset); }

static uint16_t Crc(void) {
  const uint8_t* bytes = (const uint8_t*)&settings;
  uint16_t crc = 0xffff;
  for (uint8_t i = 0; i < sizeof(settings); ++i) {
    crc = SateenCrc16(crc, bytes[i]);
  }
  return crc;
}

/* Returns whether the record is whole. */
static uint8_t Read(uint8_t* blank) {
  uint8_t* bytes = (uint8_t*)&settings;
  uint16_t crc;
  *blank = 1;
  for (uint8_t i = 0; i < sizeof(settings); ++i) {
    bytes[i] = eeprom_read_byte(At(i));
    *blank &= bytes[i] == 0xff;
  }
  crc = eeprom_read_byte(At(sizeof(settings)));
  crc |= (uint16_t)eeprom_read_byte(At(sizeof(settings) + 1)) << 8;
  *blank &= crc == 0xffff;
  return crc == Crc() && settings.mark == SETTINGS_MARK && settings.version == SETTINGS_VERSION;
}

uint8_t SettingsLoad(void) {
  uint8_t blank;
  if (Read(&blank)) {
    return 1;
  }
  if (blank) {
    SetAll(SATEEN_FULL_LEVEL, NEW_ON_MS);
    return 1;
  }
  SetAll(SAFE_LEVEL, SAFE_ON_MS);
  return 0;
}

/* The watchdog is fed for each byte: 65 of them take 220 ms. */
static void Write(uint8_t offset, uint8_t byte) {
  wdt_reset();
  eeprom_update_byte(At(offset), byte);
}

uint8_t SettingsStore(void) {
  const uint8_t* bytes = (const uint8_t*)&settings;
  const uint16_t crc = Crc();
  uint8_t same = 1;
  for (uint8_t i = 0; i < sizeof(settings); ++i) {
    Write(i, bytes[i]);
  }
  Write(sizeof(settings), (uint8_t)crc);
  Write(sizeof(settings) + 1, (uint8_t)(crc >> 8));
  for (uint8_t i = 0; i < sizeof(settings); ++i) {
    same &= eeprom_read_byte(At(i)) == bytes[i];
  }
  same &= eeprom_read_byte(At(sizeof(settings))) == (uint8_t)crc;
  same &= eeprom_read_byte(At(sizeof(settings) + 1)) == (uint8_t)(crc >> 8);
  wdt_reset();
  return same;
}
