/* Moves the host's clock for the process that it is loaded into, by as many seconds as stand in the
 * eight octets of the file TRAMMEL_TEST_CLOCK, at whatever moment they are written there. Clocks
 * that nobody sets go on as they are. */
#define _GNU_SOURCE
#include <fcntl.h>
#include <stdint.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

static const volatile int64_t* moved_by;

__attribute__((constructor)) static void open_file(void) {
  const char* name = getenv("TRAMMEL_TEST_CLOCK");
  const int file = name == NULL ? -1 : open(name, O_RDONLY | O_CLOEXEC);
  if (file < 0) return;
  void* const shared = mmap(NULL, sizeof *moved_by, PROT_READ, MAP_SHARED, file, 0);
  if (shared != MAP_FAILED) moved_by = shared;
  close(file);
}

#pragma GCC visibility push(default) /* they take the place of the C library's */

int clock_gettime(clockid_t clock, struct timespec* time) {
  const int failed = (int)syscall(SYS_clock_gettime, clock, time);
  const int is_set = clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE;
  if (failed == 0 && is_set && moved_by != NULL) time->tv_sec += *moved_by;
  return failed;
}

int gettimeofday(struct timeval* restrict value, void* restrict zone) {
  struct timespec now;
  (void)zone;
  clock_gettime(CLOCK_REALTIME, &now);
  value->tv_sec = now.tv_sec;
  value->tv_usec = now.tv_nsec / 1000;
  return 0;
}

time_t time(time_t* result) {
  struct timespec now;
  clock_gettime(CLOCK_REALTIME, &now);
  if (result != NULL) *result = now.tv_sec;
  return now.tv_sec;
}
