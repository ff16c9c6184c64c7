#ifndef SATEEN_FIRMWARE_CONTROLLER_RESET_H_
#define SATEEN_FIRMWARE_CONTROLLER_RESET_H_

/* What happens before main(), and why the board started. */

#include <stdint.h>

/* SateenResetCause bits; 0 where a bootloader hid the cause. */
uint8_t ResetCause(void);

/* Called by the 1 kHz interrupt and by every turn of the main loop: how long the loop has been stuck
 * tells a watchdog reset from another where the bootloader does not. */
void ResetNoteTick(void);
void ResetNoteLoop(void);

#endif
