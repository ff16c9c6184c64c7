#ifndef SATEEN_FIRMWARE_CONTROLLER_PINS_H_
#define SATEEN_FIRMWARE_CONTROLLER_PINS_H_

/* Pins and their uses, for the firmware and the virtual rig. docs/rig.md has the wiring.
 *
 * Every light has an enable pin, high for on, and all share the dimming line, the output of timer 1.
 * D0 and D1 are the serial port. D13 (PB5) cannot be a light's: bootloaders blink it. So there are 14
 * lights, or 16 with SATEEN_LIGHTS=16, which takes the pins of the flash sync and of the shutter. */

#ifndef SATEEN_LIGHTS
#define SATEEN_LIGHTS 14
#endif
#if SATEEN_LIGHTS != 14 && SATEEN_LIGHTS != 16
#error "SATEEN_LIGHTS is 14 or 16"
#endif

/* X(channel, port, bit, what an Arduino calls it) */
#define SATEEN_LIGHT_PINS_14(X) \
  X(0, D, 3, "D3")              \
  X(1, D, 4, "D4")              \
  X(2, D, 5, "D5")              \
  X(3, D, 6, "D6")              \
  X(4, D, 7, "D7")              \
  X(5, B, 0, "D8")              \
  X(6, B, 2, "D10")             \
  X(7, B, 3, "D11")             \
  X(8, B, 4, "D12")             \
  X(9, C, 0, "A0")              \
  X(10, C, 1, "A1")             \
  X(11, C, 2, "A2")             \
  X(12, C, 3, "A3")             \
  X(13, C, 4, "A4")
#define SATEEN_LIGHT_PINS_16(X) SATEEN_LIGHT_PINS_14(X) X(14, C, 5, "A5") X(15, D, 2, "D2")
#if SATEEN_LIGHTS == 16
#define SATEEN_LIGHT_PINS SATEEN_LIGHT_PINS_16
#else
#define SATEEN_LIGHT_PINS SATEEN_LIGHT_PINS_14
#endif

#define SATEEN_CHANNELS SATEEN_LIGHTS

/* Dimming line, OC1A: high for level_permille thousandths of each period while a light is on. */
#define SATEEN_DIM_PORT B
#define SATEEN_DIM_BIT 1
/* Flash-sync input, INT0, with pull-up; of 14 lights. */
#define SATEEN_SYNC_PORT D
#define SATEEN_SYNC_BIT 2
/* Shutter output: high closes the contact; of 14 lights. */
#define SATEEN_SHUTTER_PORT C
#define SATEEN_SHUTTER_BIT 5
/* The Arduino's own LED: on while a light is on or armed. */
#define SATEEN_INDICATOR_PORT B
#define SATEEN_INDICATOR_BIT 5

#endif /* SATEEN_FIRMWARE_CONTROLLER_PINS_H_ */
