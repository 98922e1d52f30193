#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "common.h"

/// Looks through a serialized sample before anything is made of it, so that no length that it
/// claims is believed: the generated code would reserve a hundred times the bytes of a hostile
/// sample, and accept any enumerator.
namespace trammel::wire {

using namespace v2;

/// True if the text is printable ASCII without spaces.
[[nodiscard]] bool is_token(std::string_view text);

/// Why a sample cannot be used.
struct Fault {
  ResultCode code = RESULT_MALFORMED;
  std::string what;   ///< one clause
  std::string where;  ///< the item of a list: `target 4`; empty: no item
  std::string field;
  std::optional<double> value, limit;
};

/// The fault of a request of another contract than CONTRACT_VERSION.
[[nodiscard]] Fault fault_of_contract(std::uint32_t contract_version);

/// The characters that a text may hold. None holds a NUL: it would end there for one maker's DDS,
/// and not for another's.
enum class Text {
  kAny,    ///< of a file: its reader judges it
  kPlain,  ///< a name, or a sentence: UTF-8 without control characters
  kToken   ///< printable ASCII without spaces
};

/// Goes through plain CDR (XCDR version 1, either byte order), member by member in the order of the
/// IDL. Stops at the first fault; what is asked for after that does nothing. Never reads beyond the
/// sample and reserves no memory.
class CdrWalk {
 public:
  /// `sample` begins with its encapsulation.
  explicit CdrWalk(std::span<const unsigned char> sample);

  [[nodiscard]] bool good() const { return !fault_; }
  [[nodiscard]] const std::optional<Fault>& fault() const { return fault_; }

  void octets(std::size_t count) { skip(count, 1); }
  void shorts(std::size_t count) { skip(count, 2); }
  void longs(std::size_t count) { skip(count, 4); }
  void wides(std::size_t count) { skip(count, 8); }  ///< `double`, `long long`
  void flag(const char* field);
  void enumerator(const char* field, std::uint32_t last);
  void text(const char* field, std::size_t most_bytes, Text kind);
  /// The number of elements, each of at least `least_bytes` bytes.
  [[nodiscard]] std::size_t list(const char* field, std::size_t most, std::size_t least_bytes);
  /// A list of structures or texts; `item` names one of them for people and looks through it.
  template <typename Item>
  void list(const char* field, std::size_t most, std::size_t least_bytes, const char* name,
            const Item& item) {
    const std::size_t count = list(field, most, least_bytes);
    for (std::size_t i = 0; i < count && good(); ++i) {
      item_name_ = name;
      item_ = i + 1;
      item();
    }
    item_ = 0;
  }
  /// Nothing follows but padding.
  void end();

 private:
  void align(std::size_t bytes);
  void skip(std::size_t count, std::size_t bytes);
  [[nodiscard]] std::uint32_t number(const char* field);
  [[nodiscard]] std::size_t left() const { return sample_.size() - at_; }
  void fail(ResultCode code, std::string what, const char* field);
  void fail_beyond(std::string what, const char* field, std::size_t value, std::size_t limit);

  std::span<const unsigned char> sample_;  // without its encapsulation: alignment counts from there
  std::size_t at_ = 0;
  bool little_endian_ = true;
  const char* item_name_ = "";
  std::size_t item_ = 0;  // 0: outside of lists
  std::optional<Fault> fault_;
};

}  // namespace trammel::wire
