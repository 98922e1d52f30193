#pragma once

#include <fmt/format.h>

#include <optional>
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

/// An expected failure, as data: programs and tests ask the members, people read `sentence()`. What is not known is
/// left empty.
struct Error {
  ErrorCode code = ErrorCode::kInternal;
  std::string message;          ///< one clause that says what, with value and limit: `joint 3 is 241.2 deg, limit 70.0`
  std::string file;             ///< path or id of what was read: a file, a batch, a model
  std::optional<long> row;      ///< line of the file, counted from 1 with its header
  std::string field;            ///< column, key or option
  std::optional<double> value;  ///< as read, in the unit of the field
  std::optional<double> limit;  ///< that the value should have kept, in the same unit
  std::string next;             ///< what to do about it, as one clause
};

/// The one sentence of an error, for people: `lt-07.csv row 12: joint 3 is 241.2 deg, limit 70.0; teach it again`.
[[nodiscard]] std::string sentence(const Error& error);

template <typename T>
using Result = tl::expected<T, Error>;
using Status = Result<void>;

/// A failure on its way to the caller. What is known of it is added where it is known, inner layers first: what is
/// there already stays.
class Failure : public tl::unexpected<Error> {
 public:
  explicit Failure(Error error) : tl::unexpected<Error>(std::move(error)) {}

  Failure&& in(std::string file) && {
    if (value().file.empty()) value().file = std::move(file);
    return std::move(*this);
  }
  Failure&& at_row(long row) && {
    if (!value().row) value().row = row;
    return std::move(*this);
  }
  Failure&& of(std::string field) && {
    if (value().field.empty()) value().field = std::move(field);
    return std::move(*this);
  }
  Failure&& beyond(double is, double limit) && {
    value().value = is;
    value().limit = limit;
    return std::move(*this);
  }
  Failure&& next(std::string advice) && {
    if (value().next.empty()) value().next = std::move(advice);
    return std::move(*this);
  }
};

template <typename... Args>
[[nodiscard]] Failure failure(ErrorCode code, fmt::format_string<Args...> text, Args&&... args) {
  Error error;
  error.code = code;
  error.message = fmt::format(text, std::forward<Args>(args)...);
  return Failure(std::move(error));
}

/// Data that must not be used.
template <typename... Args>
[[nodiscard]] Failure refused(fmt::format_string<Args...> text, Args&&... args) {
  return failure(ErrorCode::kRefused, text, std::forward<Args>(args)...);
}

}  // namespace trammel
