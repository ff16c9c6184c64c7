#ifndef SATEEN_FIRMWARE_CONTROLLER_LINK_H_
#define SATEEN_FIRMWARE_CONTROLLER_LINK_H_

/* Frames in, commands done, answers out. Rules and messages: docs/protocol.md. */

#include <stdint.h>

/* Announces that the board has started, and the fault that made it start if there was one. */
void LinkStart(void);
/* Takes a received byte; does and answers the command that ends with it, if one does. */
void LinkReceive(uint8_t byte);
/* Announces a fault that waits. */
void LinkAnnounceFault(void);

#endif
