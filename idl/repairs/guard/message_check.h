#pragma once

#include <optional>

#include "idl/repairs/guard/announcement_check.h"
#include "idl/repairs/guard/dropped.h"
#include "idl/repairs/guard/edited_message.h"
#include "idl/repairs/guard/guard_memory.h"
#include "idl/repairs/guard/rtps_bytes.h"

namespace trammel::wire {

struct NumberSet;

/// The fields of a DATA_FRAG; empty when it is too short.
[[nodiscard]] std::optional<Fragments> fragments_of(const Submessage& submessage);

/// One message on its way through the guard.
class MessageCheck {
 public:
  struct Circumstances {
    std::uint32_t largest_sample = 0;  // bytes
    std::uint64_t socket = 0;
    SequenceWatch::Time now{};
    bool relayed = false;  // a Relay sent it
    bool secured = false;  // participants prove who they are
    bool signs = false;    // and that each message is theirs
  };
  MessageCheck(Circumstances received, GuardMemory& memory, Bytes message, EditedMessage& edited)
      : received_(received), memory_(memory), message_(message), edited_(edited) {}

  [[nodiscard]] std::optional<Dropped> run();
  /// Why the message passes without some of what it says; empty: it does not.
  [[nodiscard]] std::optional<Dropped> left_out() const { return left_out_; }

 private:
  using Fault = std::optional<Dropped>;

  Fault check_header();
  Fault check_submessage(const Submessage& submessage, Bytes behind);
  Fault check_data(const Submessage& submessage);
  Fault check_relayed_data(const Submessage& submessage);
  Fault check_key_of_gone(const Submessage& data, Bytes key);
  void make_gap(const Submessage& data, std::int64_t number);
  void blank(const Submessage& submessage);
  /// The octets of the message that say them.
  [[nodiscard]] Bytes id_of(const Submessage& submessage) const;
  [[nodiscard]] Bytes flags_of(const Submessage& submessage) const;
  [[nodiscard]] bool is_unproven(std::uint32_t writer) const;
  [[nodiscard]] bool lacks_proof(const Submessage& submessage) const;
  void ignore_end(std::uint32_t writer, const Submessage& data, std::int64_t number);
  [[nodiscard]] bool repeats_source(Bytes body) const;
  Fault check_destination(const Submessage& submessage);
  Fault check_announced(const Submessage& submessage, std::uint32_t writer, std::int64_t number,
                        Bytes payload);
  void check_endpoint(const Submessage& submessage, std::int64_t number, Reachable& reachable)
      TRAMMEL_REQUIRES(memory_.mutex);
  void note_end_of_endpoint(std::optional<Bytes> guid);
  void blank_others(Reachable& reachable, const NamedSockets& allowed);
  Fault check_fragments(const Submessage& submessage);
  Fault cut_too_large(const Submessage& submessage, Bytes payload, std::uint32_t sample_size);
  Fault check_heartbeat(const Submessage& submessage);
  Fault check_heartbeat_frag(const Submessage& submessage);
  Fault check_gap(const Submessage& submessage);
  Fault check_repairs(std::uint32_t writer, std::int64_t base, const NumberSet& asked,
                      bool little_endian);
  Fault check_acknack(const Submessage& submessage);
  Fault check_nack_frag(const Submessage& submessage);
  Fault check_statistics(const Submessage& submessage, Bytes behind);
  Fault check_secured(const Submessage& submessage, Bytes behind);
  Fault check_count(std::uint32_t endpoint, std::uint32_t tag, std::uint32_t count);

  const Circumstances received_;
  GuardMemory& memory_;
  const Bytes message_;
  EditedMessage& edited_;
  Bytes source_{};        // prefix
  Bytes named_{};         // the prefix that announcements must name; empty: any
  bool signed_ = false;   // the library holds the whole message against its sender's key
  bool wrapped_ = false;  // and the submessage that is read against its endpoint's
  Fault left_out_{};
};

}  // namespace trammel::wire
