#include "server/dds/status_echo.h"

#include <fastdds/dds/subscriber/SampleInfo.hpp>

namespace trammel {

Result<std::unique_ptr<StatusEcho>> StatusEcho::open(wire::dds::DomainParticipant& participant,
                                                     wire::dds::Subscriber& subscriber,
                                                     const wire::dds::DataWriter& writer,
                                                     wire::HeardOfItself& heard) {
  std::unique_ptr<StatusEcho> echo(
      new StatusEcho(subscriber, wire::participant_of(participant.guid())));
  const auto& id = writer.guid().entityId.value;
  heard.first_lost_of =
      std::uint32_t{id[0]} << 24 | std::uint32_t{id[1]} << 16 | std::uint32_t{id[2]} << 8 | id[3];
  echo->reader_ = subscriber.create_datareader(writer.get_topic(), wire::state_reader_qos(),
                                               echo.get(), wire::dds::StatusMask::data_available());
  if (echo->reader_ == nullptr)
    return failure(ErrorCode::kInternal, "cannot create the reader of the own status");
  return echo;
}

StatusEcho::~StatusEcho() {
  if (reader_ != nullptr) subscriber_.delete_datareader(reader_);
}

void StatusEcho::on_data_available(wire::dds::DataReader* reader) {
  wire::ServiceStatus status;
  wire::dds::SampleInfo info;
  while (reader->take_next_sample(&status, &info) ==
         eprosima::fastrtps::types::ReturnCode_t::RETCODE_OK) {
    const auto writer = eprosima::fastrtps::rtps::iHandle2GUID(info.publication_handle);
    if (info.valid_data && wire::participant_of(writer) == self_) ++heard_;
  }
}

}  // namespace trammel
