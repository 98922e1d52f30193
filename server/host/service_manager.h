#pragma once

#include <chrono>
#include <optional>
#include <string>

/// The messages to the service manager (systemd) that started this process. Without one these
/// functions do nothing. Thread-safe.
namespace trammel {

/// It serves; also at the end of a reload.
void tell_manager_ready(const std::string& status);
void tell_manager_reloading();
void tell_manager_stopping();
/// One line for `systemctl status`.
void tell_manager_status(const std::string& status);
/// A sign of life.
void tell_manager_alive();
/// The time within which it wants the next one; empty: it wants none.
[[nodiscard]] std::optional<std::chrono::microseconds> manager_watches_every();

}  // namespace trammel
