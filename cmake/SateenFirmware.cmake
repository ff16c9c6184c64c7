# The firmware of the LED board as part of the build. It is a project of its own, because a build has
# one C compiler and it needs another. Gives SATEEN_FIRMWARE_DIR, where target sateen_firmware leaves
# sateen-controller.elf and .hex, the same for 16 lights, and sateen-controller-test.elf, the build that hangs on command.
find_program(SATEEN_AVR_GCC avr-gcc REQUIRED)
include(ExternalProject)

set(SATEEN_FIRMWARE_DIR ${PROJECT_BINARY_DIR}/avr)
ExternalProject_Add(sateen_firmware
  SOURCE_DIR ${PROJECT_SOURCE_DIR}/firmware
  BINARY_DIR ${SATEEN_FIRMWARE_DIR}
  PREFIX ${PROJECT_BINARY_DIR}/avr-project
  CMAKE_ARGS --toolchain ${PROJECT_SOURCE_DIR}/firmware/avr.cmake
  BUILD_ALWAYS ON
  INSTALL_COMMAND ""
  BUILD_BYPRODUCTS ${SATEEN_FIRMWARE_DIR}/sateen-controller.elf
                   ${SATEEN_FIRMWARE_DIR}/sateen-controller.hex
                   ${SATEEN_FIRMWARE_DIR}/sateen-controller-16.elf
                   ${SATEEN_FIRMWARE_DIR}/sateen-controller-16.hex
                   ${SATEEN_FIRMWARE_DIR}/sateen-controller-test.elf)
