#pragma once

#include <optional>
#include <string>
#include <tl/expected.hpp>
#include <vector>

/// Marks the exported symbols of libtrammel.
#define TRAMMEL_API __attribute__((visibility("default")))

/// Trammel for other programs. Nothing here throws. Lengths are mm and angles deg, as in files and
/// on the command line; frames are W (tracker world), B (robot base), F (flange) and T (tool).
namespace trammel::api {

/// The kind of an error.
enum class ErrorCode {
  kUsage,    ///< the request names something that does not exist, or an argument has the wrong size
  kRefused,  ///< data that must not be used: a bad row, an unknown tool, an ill-conditioned fit
  kNotFound,     ///< an unknown cell, model or job
  kConflict,     ///< the same id with other content, a second writer
  kTooLarge,     ///< over a stated limit
  kBusy,         ///< a bounded queue is full, or the caller gave up: try again
  kUnreachable,  ///< no service answered in time
  kInternal      ///< the disk, the database, a corrupt file of our own
};

/// The spelling for programs: `refused`, `not_found`.
[[nodiscard]] TRAMMEL_API std::string to_text(ErrorCode code);

/// An expected failure, as data. Members that are not known are empty.
struct Error {
  ErrorCode code = ErrorCode::kInternal;  ///< its kind
  std::string message;                    ///< one clause with the fault, the value and the limit
  std::string file;                       ///< path or id of the input: a file, a batch, a model
  std::optional<long>
      row;            ///< line of the file, from 1 with its header; of an array the index, from 0
  std::string field;  ///< column, key or argument
  std::optional<double> value;  ///< as given, in the unit of the field
  std::optional<double> limit;  ///< the violated limit, in the same unit
  std::string text;             ///< the value as given, where it is a word
  std::string next;             ///< the next step for the user, as one clause
  std::vector<Error> also;      ///< other errors found in the same reading
  std::string sentence;         ///< the whole error for people
};

/// A value, or why there is none.
template <typename T>
using Result = tl::expected<T, Error>;
/// Done, or why not.
using Status = Result<void>;

}  // namespace trammel::api
