#include "server/dds/reply_channel.h"

#include <algorithm>
#include <utility>

namespace trammel {
namespace {

constexpr const char* kNowhere = "trammel.nobody";  // a partition
/// Longer than a lease, so that a client that died with the last departure has been noticed.
constexpr auto kQuiet = 2 * wire::kLease;
constexpr std::size_t kKept = 8;         // for the next clients, when all is quiet
constexpr std::size_t kMostKept = 1024;  // also when it never is
constexpr std::size_t kDeletedAtOnce = 4;

/// The first two octets of a participant's id name the maker of its library (RTPS 2.3, 9.3.1.5).
bool follows_to_another_partition(const std::string& participant) {
  return participant.starts_with("\x01\x0f");
}

}  // namespace

ReplyWriter::ReplyWriter(wire::dds::Publisher& publisher, std::function<void()> matched,
                         InsteadOf instead)
    : publisher_(publisher), matched_(std::move(matched)), instead_(std::move(instead)) {}

std::shared_ptr<ReplyWriter> ReplyWriter::make(wire::dds::Publisher& publisher,
                                               wire::dds::Topic* topic,
                                               std::function<void()> matched, InsteadOf instead) {
  std::shared_ptr<ReplyWriter> result(
      new ReplyWriter(publisher, std::move(matched), std::move(instead)));
  result->writer_ =
      publisher.create_datawriter(topic, wire::call_writer_qos(wire::kReplyDepth), result.get(),
                                  wire::dds::StatusMask::publication_matched());
  return result->writer_ == nullptr ? nullptr : result;
}

bool ReplyWriter::write(void* reply) {
  if (writer_->write(reply)) return true;
  const std::shared_ptr<void> error = instead_ ? instead_(reply) : nullptr;
  return error && writer_->write(error.get());
}

ReplyWriter::~ReplyWriter() {
  if (writer_ != nullptr) publisher_.delete_datawriter(writer_);
}

void ReplyWriter::on_publication_matched(wire::dds::DataWriter*,
                                         const wire::dds::PublicationMatchedStatus& status) {
  readers_ = status.current_count;
  if (status.current_count_change > 0) matched_();
}

ReplyChannel::ReplyChannel(wire::dds::DomainParticipant& participant, const std::string& partition)
    : participant_(participant),
      partition_(partition),
      publisher_(participant.create_publisher(wire::publisher_qos(partition))) {}

ReplyChannel::~ReplyChannel() {
  writers_.clear();
  if (publisher_ != nullptr) participant_.delete_publisher(publisher_);
}

ReplyChannel::Writer ReplyChannel::writer(const std::string& topic) const {
  const auto found = writers_.find(topic);
  return found == writers_.end() ? nullptr : found->second;
}

bool ReplyChannel::is_in_use() const {
  return std::any_of(writers_.begin(), writers_.end(),
                     [](const auto& one) { return one.second.use_count() > 1; });
}

bool ReplyChannel::has_readers() const {
  return std::any_of(writers_.begin(), writers_.end(),
                     [](const auto& one) { return one.second->has_reader(); });
}

bool ReplyChannel::move_to(const std::string& partition) {
  if (publisher_->set_qos(wire::publisher_qos(partition)) !=
      eprosima::fastrtps::types::ReturnCode_t::RETCODE_OK)
    return false;
  partition_ = partition;
  return true;
}

void ParkedChannels::park(Channel channel, Time now) {
  last_parked_ = now;
  if (channel->publisher() == nullptr) return;
  if (channel->has_readers() && !channel->move_to(kNowhere))
    return;  // its client is still there, but gets no replies
  parked_.push_back(std::move(channel));
}

ParkedChannels::Channel ParkedChannels::take(const std::string& participant,
                                             const std::string& partition) {
  const auto own = std::find_if(parked_.begin(), parked_.end(),
                                [&](const Channel& one) { return one->partition() == partition; });
  if (own != parked_.end()) {
    Channel channel = std::move(*own);
    parked_.erase(own);
    return channel;
  }
  if (parked_.empty() || !follows_to_another_partition(participant)) return nullptr;
  Channel channel = std::move(parked_.back());
  parked_.pop_back();
  return channel->move_to(partition) ? channel : nullptr;
}

bool ParkedChannels::tend(Time now) {
  const std::size_t most = now - last_parked_ > kQuiet ? kKept : kMostKept;
  if (parked_.size() <= most) return false;
  parked_.erase(parked_.begin(), parked_.begin() + static_cast<std::ptrdiff_t>(std::min(
                                                       kDeletedAtOnce, parked_.size() - most)));
  return parked_.size() > most;
}

}  // namespace trammel
