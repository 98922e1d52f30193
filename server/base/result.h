#pragma once

#include <fmt/format.h>

#include <optional>
#include <string>
#include <string_view>
#include <tl/expected.hpp>
#include <type_traits>
#include <utility>
#include <vector>

namespace trammel {

/// The kind of an error. It decides exit codes and reply codes, never the wording.
enum class ErrorCode {
  kUsage,     ///< the caller asked for something that does not exist (exit 2)
  kRefused,   ///< data that must not be used: bad row, unknown tool, ill-conditioned fit (exit 3)
  kNotFound,  ///< an unknown cell, model or job (exit 3)
  kConflict,  ///< the same id with other content, a second writer (exit 3)
  kTooLarge,  ///< over a stated limit (exit 3)
  kBusy,      ///< a bounded queue is full; try again (exit 4)
  kUnreachable,  ///< no service answered in time (exit 4)
  kInternal      ///< the disk, the database, a corrupt file of our own (exit 3)
};

/// The spelling for programs: `refused`, `not_found`.
[[nodiscard]] const char* to_text(ErrorCode code);

/// An expected failure, as data. Programs and tests read the members, people read `sentence()`.
/// Members that are not known are empty.
struct Error {
  ErrorCode code = ErrorCode::kInternal;
  std::string message;  ///< one clause with the fault, the value and the limit: `joint 3 is 241.2
                        ///< deg, limit 70.0`
  std::string file;     ///< path or id of the input: a file, a batch, a model
  std::optional<long> row;      ///< line of the file, counted from 1 with its header
  std::string field;            ///< column, key (`tools: spindle: xyz_mm`) or option
  std::optional<double> value;  ///< as read, in the unit of the field
  std::optional<double> limit;  ///< the violated limit, in the same unit
  std::string text;             ///< the value as read, where it is a word
  std::string next;             ///< the next step for the user, as one clause
  std::vector<Error> also;      ///< other errors found in the same reading
};

/// The one sentence of an error, for people: `lt-07.csv row 12: joint 3 is 241.2 deg, limit 70.0;
/// teach it again`. One more line for each error in `also`.
[[nodiscard]] std::string sentence(const Error& error);

/// One error that holds all: the first, with the others in `also`. `problems` is not empty.
[[nodiscard]] Error together(std::vector<Error> problems);
/// The reverse: every error by itself, with an empty `also`.
[[nodiscard]] std::vector<Error> apart(const Error& error);

template <typename T>
using Result = tl::expected<T, Error>;
using Status = Result<void>;

/// A failure on its way to the caller. Each layer adds its context, inner layers first. Members
/// that are already set do not change.
class Failure : public tl::unexpected<Error> {
 public:
  explicit Failure(Error error) : tl::unexpected<Error>(std::move(error)) {}

  /// Changes the kind of the error. Example: an unknown word in a file is no wrong usage of a
  /// command.
  Failure&& as(ErrorCode code) && {
    value().code = code;
    return std::move(*this);
  }
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
  /// Adds the key, column or option that the error is about. It stands before the message and
  /// before an inner field.
  Failure&& under(const std::string& key) && {
    value().message = key + ": " + value().message;
    value().field = value().field.empty() ? key : key + ": " + value().field;
    return std::move(*this);
  }
  template <typename Number, typename Limit>
  Failure&& beyond(Number is, Limit limit) && {
    if (!value().limit) {
      value().value = static_cast<double>(is);
      value().limit = static_cast<double>(limit);
    }
    return std::move(*this);
  }
  template <typename Number>
  Failure&& with_value(Number is) && {
    if (!value().value) value().value = static_cast<double>(is);
    return std::move(*this);
  }
  Failure&& with_text(std::string_view is) && {
    if (value().text.empty()) value().text = is;
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

/// The value that `TRY` returns: a copy for a named result, the moved value for a temporary one.
template <typename R>
auto value_of(R&& result) {
  if constexpr (!std::is_void_v<typename std::remove_cvref_t<R>::value_type>)
    return *std::forward<R>(result);
}

/// Data that must not be used.
template <typename... Args>
[[nodiscard]] Failure refused(fmt::format_string<Args...> text, Args&&... args) {
  return failure(ErrorCode::kRefused, text, std::forward<Args>(args)...);
}

}  // namespace trammel

/// The value of a `Result`, or an early return: if `expression` failed, the enclosing function
/// returns its error unchanged. A `Status` has no value. Example: `const Cell cell =
/// TRY(read_cell(path));`
#define TRY(expression)                                                                      \
  (__extension__({                                                                           \
    auto&& tried_ = (expression);                                                            \
    if (!tried_) return tl::make_unexpected(std::forward<decltype(tried_)>(tried_).error()); \
    trammel::value_of(std::forward<decltype(tried_)>(tried_));                               \
  }))
