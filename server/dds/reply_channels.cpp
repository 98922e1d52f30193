#include "server/dds/reply_channels.h"

#include <algorithm>
#include <utility>
#include <vector>

namespace trammel {
namespace {

using Clock = std::chrono::steady_clock;

/// A client's reader is matched within a few announcements, or never.
constexpr auto kPatience = 5 * wire::kAnnouncement;
constexpr std::size_t kSweptAtOnce = 16;  // clients; each is up to six endpoints to delete

}  // namespace

ReplyWriter::ReplyWriter(wire::dds::Publisher& publisher)
    : publisher_(publisher), patient_until_(Clock::now() + kPatience) {}

std::unique_ptr<ReplyWriter> ReplyWriter::make(wire::dds::Publisher& publisher, wire::dds::Topic* topic) {
  std::unique_ptr<ReplyWriter> result(new ReplyWriter(publisher));
  result->writer_ = publisher.create_datawriter(topic, wire::call_writer_qos(wire::kReplyDepth), result.get(),
                                                wire::dds::StatusMask::publication_matched());
  return result->writer_ == nullptr ? nullptr : std::move(result);
}

ReplyWriter::~ReplyWriter() {
  if (writer_ != nullptr) publisher_.delete_datawriter(writer_);
}

bool ReplyWriter::send(void* reply, const std::stop_token& stop) {
  {
    MutexLock lock(mutex_);
    const Clock::time_point until = patient_until_;
    matched_.wait_until(lock, stop, until, [this]() TRAMMEL_REQUIRES(mutex_) { return readers_ > 0; });
    if (readers_ == 0) return false;
  }
  return writer_->write(reply);
}

bool ReplyWriter::abandoned() const {
  const MutexLock lock(mutex_);
  return readers_ == 0 && Clock::now() > patient_until_;
}

void ReplyWriter::on_publication_matched(wire::dds::DataWriter*, const wire::dds::PublicationMatchedStatus& status) {
  {
    const MutexLock lock(mutex_);
    readers_ = status.current_count;
    if (readers_ == 0) patient_until_ = Clock::now() + kPatience;
  }
  matched_.notify_all();
}

class ReplyChannels::Client {
 public:
  explicit Client(wire::dds::DomainParticipant& participant, const std::string& partition)
      : participant_(participant), publisher_(participant.create_publisher(wire::publisher_qos(partition))) {}
  ~Client() {
    writers_.clear();
    if (publisher_ != nullptr) participant_.delete_publisher(publisher_);
  }
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;

  /// Null when DDS refuses.
  [[nodiscard]] ReplyWriter* writer(wire::dds::Topic* topic) {
    const MutexLock lock(mutex_);
    auto& writer = writers_[topic];
    if (!writer && publisher_ != nullptr) writer = ReplyWriter::make(*publisher_, topic);
    return writer.get();
  }

  [[nodiscard]] bool left() const {
    const MutexLock lock(mutex_);
    return std::all_of(writers_.begin(), writers_.end(),
                       [](const auto& entry) { return !entry.second || entry.second->abandoned(); });
  }

 private:
  wire::dds::DomainParticipant& participant_;
  wire::dds::Publisher* publisher_;
  mutable Mutex mutex_;
  std::map<wire::dds::Topic*, std::unique_ptr<ReplyWriter>> writers_ TRAMMEL_GUARDED_BY(mutex_);
};

void ReplyChannels::add_topic(wire::dds::Topic* topic) {
  const MutexLock lock(mutex_);
  topics_[topic->get_name()] = topic;
}

void ReplyChannels::expect(const std::string& partition, const std::string& topic) {
  wire::dds::Topic* known = nullptr;
  {
    const MutexLock lock(mutex_);
    const auto found = topics_.find(topic);
    if (found == topics_.end()) return;
    known = found->second;
  }
  if (const auto to = client(partition, false)) static_cast<void>(to->writer(known));
}

bool ReplyChannels::send(const std::string& partition, wire::dds::Topic* topic, void* reply,
                         const std::stop_token& stop) {
  const std::shared_ptr<Client> to = client(partition, true);
  ReplyWriter* writer = to->writer(topic);
  return writer != nullptr && writer->send(reply, stop);
}

std::shared_ptr<ReplyChannels::Client> ReplyChannels::client(const std::string& partition, bool crowd_out) {
  std::shared_ptr<Client> crowded_out;  // destroyed without the lock
  const MutexLock lock(mutex_);
  if (!crowd_out && clients_.size() >= capacity_ && !clients_.contains(partition)) return nullptr;
  Known& known = clients_[partition];
  if (!known.client) known.client = std::make_shared<Client>(participant_, partition);
  known.last_used = Clock::now();
  const std::shared_ptr<Client> result = known.client;
  if (clients_.size() > capacity_) {
    const auto oldest = std::min_element(clients_.begin(), clients_.end(), [](const auto& a, const auto& b) {
      return a.second.last_used < b.second.last_used;
    });
    crowded_out = std::move(oldest->second.client);
    clients_.erase(oldest);
  }
  return result;
}

bool ReplyChannels::sweep() {
  std::vector<std::shared_ptr<Client>> gone;  // destroyed without the lock
  const MutexLock lock(mutex_);
  for (auto entry = clients_.begin(); entry != clients_.end() && gone.size() < kSweptAtOnce;) {
    const bool idle = Clock::now() - entry->second.last_used > kPatience;
    if (idle && entry->second.client->left()) {
      gone.push_back(std::move(entry->second.client));
      entry = clients_.erase(entry);
    } else {
      ++entry;
    }
  }
  return gone.size() == kSweptAtOnce;
}

std::size_t ReplyChannels::clients() const {
  const MutexLock lock(mutex_);
  return clients_.size();
}

}  // namespace trammel
