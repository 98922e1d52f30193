#pragma once

#include <optional>

#include "idl/guard/guard.h"

namespace trammel::wire {

/// The fields of a DATA_FRAG; empty when it is too short.
[[nodiscard]] std::optional<Fragments> fragments_of(const Submessage& submessage);

/// One message on its way through the guard.
class MessageCheck {
 public:
  MessageCheck(Guard& guard, Bytes message, std::uint64_t socket, Guard::Time now, EditedMessage& edited)
      : guard_(guard), message_(message), socket_(socket), now_(now), edited_(edited) {}

  [[nodiscard]] std::optional<Dropped> run();

 private:
  using Fault = std::optional<Dropped>;

  Fault check_header();
  Fault check_submessage(const Submessage& submessage, Bytes behind);
  Fault check_data(const Submessage& submessage);
  Fault check_announced(std::uint32_t writer, Bytes payload);
  Fault check_fragments(const Submessage& submessage);
  Fault check_heartbeat(const Submessage& submessage);
  Fault check_heartbeat_frag(const Submessage& submessage);
  Fault check_gap(const Submessage& submessage);
  Fault check_acknack(const Submessage& submessage);
  Fault check_nack_frag(const Submessage& submessage);
  Fault check_statistics(const Submessage& submessage, Bytes behind);
  Fault check_secured(const Submessage& submessage, Bytes behind);
  Fault check_count(std::uint32_t endpoint, std::uint32_t tag, std::uint32_t count);

  Guard& guard_;
  Bytes message_;
  std::uint64_t socket_;
  Guard::Time now_;
  EditedMessage& edited_;
  Bytes source_{};  // prefix
};

}  // namespace trammel::wire
