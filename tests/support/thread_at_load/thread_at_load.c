/* A library that starts a thread when it is loaded, as OpenBLAS does. The thread blocks no signal.
 * Its name is `at_load`. */
#define _GNU_SOURCE
#include <pthread.h>
#include <signal.h>
#include <unistd.h>

static void* idle(void* nothing) {
  sigset_t none;
  sigemptyset(&none);
  pthread_sigmask(SIG_SETMASK, &none, NULL);
  pthread_setname_np(pthread_self(), "at_load");
  for (;;) pause();
  return nothing;
}

__attribute__((constructor)) static void start(void) {
  pthread_t thread;
  pthread_create(&thread, NULL, idle, NULL);
}
