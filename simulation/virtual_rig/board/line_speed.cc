#include "simulation/virtual_rig/board/line_speed.h"

// The kernel's structure, which knows speeds that are no constant of POSIX, as libserialport sets
// them. It cannot be included together with <termios.h>, hence this file.
#include <asm/termbits.h>
#include <sys/ioctl.h>

namespace sateen {

double LineSpeed(int descriptor) {
  termios2 settings = {};
  return ioctl(descriptor, TCGETS2, &settings) == 0 ? settings.c_ospeed : 0;
}

}  // namespace sateen
