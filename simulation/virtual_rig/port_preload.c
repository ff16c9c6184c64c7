/* Makes the virtual board's pseudo terminal look like the serial port of a USB device, for a program
 * that is started with LD_PRELOAD=<this library> and SATEEN_VIRTUAL_PORT=<folder> (virtual_port.h
 * says what the folder holds):
 *
 *     /sys/class/tty...           is read under   <folder>/class/tty...
 *     /dev/ttyACM*, /dev/ttyUSB*  are opened as   <folder>/dev/ttyACM*, ...
 *     modem lines (DTR, RTS, CTS, DSR, DCD), which a pseudo terminal has not, are remembered
 *
 * libserialport 0.1.1 needs all three: it lists /sys/class/tty, looks a port up there before it opens
 * it, and gives up where TIOCMGET fails. The real serial ports of the machine are out of sight, so
 * that nothing meant for the virtual board ever reaches a real one.
 *
 * Only calls that name a path or ask for modem lines are looked at; reading and writing are not. */
#include <dirent.h>
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <unistd.h>

/* The names are the C library's, types stand for no expression, and bounds are checked.
 * NOLINTBEGIN(bugprone-*,concurrency-*,clang-analyzer-security.insecureAPI.*) */

/* glibc's headers declare these only to programs of older versions, or not at all. */
int __open_2(const char* path, int flags);
int __open64_2(const char* path, int flags);
int __lxstat(int version, const char* path, struct stat* status);
int __xstat(int version, const char* path, struct stat* status);
ssize_t __readlink_chk(const char* path, char* target, size_t size, size_t room);

/* The next definition of this function after ours, which is the C library's. */
#define REAL(type, name, ...)                \
  static type (*real)(__VA_ARGS__);          \
  if (real == NULL) {                        \
    *(void**)&real = dlsym(RTLD_NEXT, name); \
    if (real == NULL) {                      \
      abort();                               \
    }                                        \
  }

static int StartsWith(const char* text, const char* start) {
  return strncmp(text, start, strlen(start)) == 0;
}

/* `path`, or what stands for it, in `buffer`. */
static const char* Rewrite(const char* path, char buffer[PATH_MAX]) {
  const char* folder = getenv("SATEEN_VIRTUAL_PORT");
  if (folder == NULL || path == NULL) {
    return path;
  }
  const char* rest = NULL;
  if (strcmp(path, "/sys/class/tty") == 0 || StartsWith(path, "/sys/class/tty/")) {
    rest = path + strlen("/sys");
  } else if (StartsWith(path, "/dev/ttyACM") || StartsWith(path, "/dev/ttyUSB")) {
    rest = path;
  }
  if (rest == NULL || snprintf(buffer, PATH_MAX, "%s%s", folder, rest) >= PATH_MAX) {
    return path;
  }
  return buffer;
}

/* open() and its like take a mode only where they may create a file. */
#define OPEN(name)                                   \
  int name(const char* path, int flags, ...) {       \
    REAL(int, #name, const char*, int, ...)          \
    mode_t mode = 0;                                 \
    if ((flags & (O_CREAT | __O_TMPFILE)) != 0) {    \
      va_list arguments;                             \
      va_start(arguments, flags);                    \
      mode = va_arg(arguments, mode_t);              \
      va_end(arguments);                             \
    }                                                \
    char buffer[PATH_MAX];                           \
    return real(Rewrite(path, buffer), flags, mode); \
  }
OPEN(open)
OPEN(open64)

int __open_2(const char* path, int flags) { return open(path, flags); }
int __open64_2(const char* path, int flags) { return open64(path, flags); }

FILE* fopen(const char* path, const char* mode) {
  REAL(FILE*, "fopen", const char*, const char*)
  char buffer[PATH_MAX];
  return real(Rewrite(path, buffer), mode);
}

FILE* fopen64(const char* path, const char* mode) { return fopen(path, mode); }

DIR* opendir(const char* path) {
  REAL(DIR*, "opendir", const char*)
  char buffer[PATH_MAX];
  return real(Rewrite(path, buffer));
}

int access(const char* path, int mode) {
  REAL(int, "access", const char*, int)
  char buffer[PATH_MAX];
  return real(Rewrite(path, buffer), mode);
}

#define STAT(name, type)                        \
  int name(const char* path, type* status) {    \
    REAL(int, #name, const char*, type*)        \
    char buffer[PATH_MAX];                      \
    return real(Rewrite(path, buffer), status); \
  }
STAT(stat, struct stat)
STAT(lstat, struct stat)
STAT(stat64, struct stat64)
STAT(lstat64, struct stat64)

int __lxstat(int version, const char* path, struct stat* status) {
  (void)version;
  return lstat(path, status);
}

int __xstat(int version, const char* path, struct stat* status) {
  (void)version;
  return stat(path, status);
}

ssize_t readlink(const char* path, char* target, size_t size) {
  REAL(ssize_t, "readlink", const char*, char*, size_t)
  char buffer[PATH_MAX];
  return real(Rewrite(path, buffer), target, size);
}

ssize_t __readlink_chk(const char* path, char* target, size_t size, size_t room) {
  return readlink(path, target, size < room ? size : room);
}

/* The lines that the host drives; those of the board's end are always there. */
static atomic_int lines_out;

int ioctl(int descriptor, unsigned long request, ...) {
  REAL(int, "ioctl", int, unsigned long, ...)
  va_list arguments;
  va_start(arguments, request);
  void* argument = va_arg(arguments, void*);
  va_end(arguments);
  const int before = errno;
  const int result = real(descriptor, request, argument);
  if (result >= 0 || (errno != ENOTTY && errno != EINVAL) || !isatty(descriptor)) {
    return result;
  }
  const int ours = TIOCM_DTR | TIOCM_RTS;
  int* lines = argument;
  switch (request) {
    case TIOCMGET:
      *lines = atomic_load(&lines_out) | TIOCM_CTS | TIOCM_DSR | TIOCM_CAR;
      break;
    case TIOCMSET:
      atomic_store(&lines_out, *lines & ours);
      break;
    case TIOCMBIS:
      atomic_fetch_or(&lines_out, *lines & ours);
      break;
    case TIOCMBIC:
      atomic_fetch_and(&lines_out, ~(*lines & ours));
      break;
    default:
      return result;
  }
  errno = before;
  return 0;
}

/* NOLINTEND(bugprone-*,concurrency-*,clang-analyzer-security.insecureAPI.*) */
