#ifndef SATEEN_FIRMWARE_CONTROLLER_RESET_H_
#define SATEEN_FIRMWARE_CONTROLLER_RESET_H_

/* Start of the board before main(), and its cause. */

#include <stdint.h>

/* SateenResetCause bits; 0 where a bootloader hid the cause. */
uint8_t ResetCause(void);

/* Note that the 1 kHz interrupt and a turn of the main loop ran. How long the loop has been stuck
 * tells a watchdog reset from another where the bootloader does not. */
void ResetNoteTick(void);
void ResetNoteLoop(void);

#endif
