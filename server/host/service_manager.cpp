#include "server/host/service_manager.h"

#include <fmt/format.h>
#include <systemd/sd-daemon.h>
#include <time.h>

#include "server/base/plain_text.h"

namespace trammel {
namespace {

/// Sends a message for people; nothing here depends on its delivery.
void notify(const std::string& state) { static_cast<void>(::sd_notify(0, state.c_str())); }

long long monotonic_us() {
  timespec now{};
  ::clock_gettime(CLOCK_MONOTONIC, &now);
  return now.tv_sec * 1'000'000LL + now.tv_nsec / 1000;
}

}  // namespace

void tell_manager_ready(const std::string& status) {
  notify(fmt::format("READY=1\nSTATUS={}", shown(status)));
}

void tell_manager_reloading() {
  notify(fmt::format("RELOADING=1\nMONOTONIC_USEC={}", monotonic_us()));
}

void tell_manager_stopping() { notify("STOPPING=1\nSTATUS=stops"); }

void tell_manager_status(const std::string& status) { notify("STATUS=" + shown(status)); }

void tell_manager_alive() { notify("WATCHDOG=1"); }

std::optional<std::chrono::microseconds> manager_watches_every() {
  std::uint64_t period_us = 0;
  if (::sd_watchdog_enabled(0, &period_us) <= 0) return std::nullopt;
  return std::chrono::microseconds(period_us);
}

}  // namespace trammel
