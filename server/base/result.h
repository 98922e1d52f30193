#pragma once

#include <fmt/format.h>

#include <string>
#include <tl/expected.hpp>
#include <utility>

namespace trammel {

/// What kind of thing went wrong; decides exit codes and reply codes, never the wording.
enum class ErrorCode {
  kUsage,        ///< the caller asked for something that does not exist (exit 2)
  kRefused,      ///< data that must not be used: bad row, unknown tool, ill-conditioned fit (exit 3)
  kNotFound,     ///< an unknown cell, model or job (exit 3)
  kConflict,     ///< the same id with other content, a second writer (exit 3)
  kTooLarge,     ///< over a stated limit (exit 3)
  kBusy,         ///< a bounded queue is full; try again (exit 4)
  kUnreachable,  ///< no service answered in time (exit 4)
  kInternal      ///< the disk, the database, a corrupt file of our own (exit 3)
};

/// An expected failure. `message` says what, where, value and limit:
/// `batch lt-07 row 12: joint 3 is 241.2 deg, limit 70.0`.
struct Error {
  ErrorCode code = ErrorCode::kInternal;
  std::string message;
};

template <typename T>
using Result = tl::expected<T, Error>;
using Status = Result<void>;

template <typename... Args>
[[nodiscard]] tl::unexpected<Error> failure(ErrorCode code, fmt::format_string<Args...> text, Args&&... args) {
  return tl::make_unexpected(Error{code, fmt::format(text, std::forward<Args>(args)...)});
}

/// Data that must not be used.
template <typename... Args>
[[nodiscard]] tl::unexpected<Error> refused(fmt::format_string<Args...> text, Args&&... args) {
  return failure(ErrorCode::kRefused, text, std::forward<Args>(args)...);
}

}  // namespace trammel
