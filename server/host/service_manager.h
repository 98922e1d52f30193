#pragma once

#include <chrono>
#include <optional>
#include <string>

/// What the manager of services (systemd) that started this process is told. Without one all of
/// this does nothing. Thread-safe.
namespace trammel {

/// It serves; also at the end of a reload.
void tell_manager_ready(const std::string& status);
void tell_manager_reloading();
void tell_manager_stopping();
/// One line for `systemctl status`.
void tell_manager_status(const std::string& status);
/// A sign of life.
void tell_manager_alive();
/// How often it wants one at most; empty: never.
[[nodiscard]] std::optional<std::chrono::microseconds> manager_watches_every();

}  // namespace trammel
