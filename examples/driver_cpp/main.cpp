// Takes a seat through `race gateway` and drives a race: driver "ADDRESS" [NAME]

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <iomanip>
#include <optional>
#include <regex>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>

#include <boost/asio/connect.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/websocket.hpp>
#include <boost/property_tree/json_parser.hpp>
#include <boost/property_tree/ptree.hpp>

#include "drive_generated.h"
#include "pursuit.hpp"

namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace websocket = beast::websocket;
using Words = boost::property_tree::ptree;

constexpr int snapshots_hz = 60;  // each is answered with a control
constexpr std::uint32_t use_item = 1, accept_rescue = 2;  // bits of the buttons
constexpr std::uint8_t rescue_offered = 4;                // bit of a kart's flags
constexpr std::uint8_t running = 2;                       // phase of a race
constexpr std::uint8_t finished = 2, retired = 3;         // status of a kart
constexpr std::uint16_t lap_event = 2;                    // kind of an event
// A button acts when it goes down, so it is pressed and let go by turns.
constexpr std::uint32_t press_ticks = 6;

// The way to a seat: what `race gateway --drivers 1` prints.
struct Address {
  std::string host, port, token;
};

Address read_address(const std::string& text) {
  static const std::regex form(R"(http://([^/:]+):(\d+)/#drive&token=([\w-]+))");
  std::smatch found;
  if (!std::regex_match(text, found, form)) {
    throw std::runtime_error(
        "the address is none of http://HOST:PORT/#drive&token=TOKEN; give it whole, in quotes");
  }
  return {found[1], found[2], found[3]};
}

// A WebSocket to the gateway, read and written by turns.
class Channel {
 public:
  explicit Channel(const Address& address) : socket_(context_) {
    asio::ip::tcp::resolver resolver(context_);
    asio::connect(socket_.next_layer(), resolver.resolve(address.host, address.port));
    socket_.next_layer().set_option(asio::ip::tcp::no_delay(true));
    socket_.set_option(websocket::stream_base::decorator([](websocket::request_type& request) {
      request.set(beast::http::field::sec_websocket_protocol, "race.1");
    }));
    socket_.handshake(address.host + ":" + address.port, "/ws");
  }

  void send(const std::string& words) {
    socket_.text(true);
    socket_.write(asio::buffer(words));
  }

  void send(const flatbuffers::FlatBufferBuilder& message) {
    socket_.binary(true);
    socket_.write(asio::buffer(message.GetBufferPointer(), message.GetSize()));
  }

  // Returns the next message, and whether it is words.
  std::pair<std::string, bool> hear() {
    beast::flat_buffer buffer;
    socket_.read(buffer);
    return {beast::buffers_to_string(buffer.data()), socket_.got_text()};
  }

  void close() { socket_.close(websocket::close_code::normal); }

 private:
  asio::io_context context_;
  websocket::stream<asio::ip::tcp::socket> socket_;
};

// Returns the table in a message, nullptr where it is another or damaged.
template <typename Table>
const Table* table_in(const std::string& message, const char* identifier) {
  const auto* data = reinterpret_cast<const std::uint8_t*>(message.data());
  flatbuffers::Verifier verifier(data, message.size());
  const bool is_it = message.size() >= 8 && flatbuffers::BufferHasIdentifier(data, identifier) &&
                     verifier.VerifyBuffer<Table>(identifier);
  return is_it ? flatbuffers::GetRoot<Table>(data) : nullptr;
}

double seconds(std::int64_t microseconds) { return 1e-6 * static_cast<double>(microseconds); }

class Driver {
 public:
  Driver(const Address& address, const std::string& name) : channel_(address) {
    std::ostringstream hello;
    hello << R"({"role": "drive", "token": ")" << address.token << R"(", "name": )"
          << std::quoted(name) << R"(, "rate": )" << snapshots_hz << "}";
    channel_.send(hello.str());
  }

  // Drives until the race is over for us, and returns whether we came home.
  bool drive() {
    while (!outcome_) {
      const auto [message, is_words] = channel_.hear();
      if (is_words) {
        hear_words(message);
      } else {
        hear_bytes(message);
      }
    }
    channel_.close();
    return *outcome_;
  }

 private:
  void hear_words(const std::string& text) {
    Words words;
    std::istringstream stream(text);
    boost::property_tree::read_json(stream, words);
    const auto type = words.get<std::string>("type");
    const auto reason = words.get<std::string>("reason", "");
    if (type == "welcome") {
      seat_ = words.get<int>("seat");
      sequence_ = words.get<std::uint32_t>("sequence");
      std::printf("seat %d of session %s\n", seat_, words.get<std::string>("session").c_str());
    } else if (type == "refused") {
      throw std::runtime_error("refused: " + reason);
    } else if (type == "ready" && !words.get<bool>("accepted")) {
      throw std::runtime_error("not accepted as ready: " + reason);
    } else if (type == "notice" && !reason.empty()) {
      std::printf("%s\n", reason.c_str());
    }
  }

  void hear_bytes(const std::string& message) {
    if (const auto* snapshot = table_in<race::spectate::Snapshot>(message, "RSNP")) {
      answer(*snapshot);
    } else if (const auto* hud = table_in<race::drive::Hud>(message, "RHUD")) {
      epoch_ = hud->epoch();
      item_ = hud->item();
      limits_ = {hud->speed_cap(), hud->grip_scale()};
    } else if (const auto* events = table_in<race::spectate::Events>(message, "REVT")) {
      note(*events);
    } else if (const auto* standings = table_in<race::spectate::Standings>(message, "RSTD")) {
      look(*standings);
    } else if (table_in<race::session::Course>(message, "RCRS") != nullptr) {
      course_ = message;
    } else if (table_in<race::session::Line>(message, "RLIN") != nullptr) {
      line_ = message;
    } else if (const auto* briefing = table_in<race::session::Briefing>(message, "RBRF")) {
      get_ready(*briefing);
    }
  }

  // The briefing comes after course and line.
  void get_ready(const race::session::Briefing& briefing) {
    const auto* course = table_in<race::session::Course>(course_, "RCRS");
    const auto* line = table_in<race::session::Line>(line_, "RLIN");
    if (course == nullptr || line == nullptr || line->x()->size() == 0) {
      throw std::runtime_error(
          "this race has no reference line, and this driver knows nothing else");
    }
    pursuit_.emplace(briefing, *course, *line);
    std::printf("%u laps of %s; the reference line's lap takes %.2f s\n", briefing.laps(),
                course->name()->c_str(), line->lap());
    if (line->note()->size() > 0) {
      std::printf("%s\n", line->note()->c_str());
    }
    channel_.send(R"({"type": "ready", "ready": true})");
  }

  void answer(const race::spectate::Snapshot& snapshot) {
    const auto& karts = *snapshot.karts();
    const auto kart = std::find_if(karts.begin(), karts.end(),
                                   [&](const auto* one) { return one->seat() == seat_; });
    if (!pursuit_ || kart == karts.end() || epoch_ != snapshot.epoch()) {
      return;
    }
    const bool is_on = snapshot.phase() == running && snapshot.lights() == 0.0f;
    const Wishes wishes = is_on ? pursuit_->decide(**kart, karts, limits_) : Wishes{};
    const bool presses = snapshot.tick() / press_ticks % 2 == 0;
    const std::uint32_t buttons = (is_on && presses && item_ != 0 ? use_item : 0) |
                                  (((*kart)->flags() & rescue_offered) != 0 ? accept_rescue : 0);
    sequence_ = std::max(sequence_, (*kart)->acknowledged()) + 1;
    // `epoch` and `tick` are the gateway's matter.
    const race::drive::Control control(0, sequence_, 0, static_cast<float>(wishes.steering),
                                       static_cast<float>(wishes.throttle),
                                       static_cast<float>(wishes.brake), buttons);
    flatbuffers::FlatBufferBuilder builder;
    builder.Finish(race::drive::CreateControlMessage(builder, &control), "RCTL");
    channel_.send(builder);
  }

  void note(const race::spectate::Events& events) {
    for (const auto* event : *events.events()) {
      if (events.epoch() == epoch_ && event->kind() == lap_event && event->kart() == seat_) {
        std::printf("lap %d: %.3f s\n", event->other(), seconds(event->value()));
      }
    }
  }

  void look(const race::spectate::Standings& standings) {
    for (const auto* row : *standings.rows()) {
      if (standings.epoch() != epoch_ || row->seat() != seat_) {
        continue;
      }
      if (row->status() == finished) {
        std::printf("finished in %.3f s, place %d of %u\n", seconds(row->race_time_us()),
                    row->rank(), standings.rows()->size());
        outcome_ = true;
      } else if (row->status() == retired) {
        std::printf("out of the race after %u laps\n", row->laps());
        outcome_ = false;
      }
    }
  }

  Channel channel_;
  int seat_ = -1;
  std::uint32_t sequence_ = 0;
  std::optional<std::uint32_t> epoch_;  // of our race, once it has begun
  int item_ = 0;
  Limits limits_;
  std::string course_, line_;  // messages
  std::optional<Pursuit> pursuit_;
  std::optional<bool> outcome_;
};

}  // namespace

int main(int count, char** words) {
  if (count < 2 || count > 3) {
    std::fprintf(stderr, "usage: %s \"ADDRESS\" [NAME]\n", words[0]);
    return 2;
  }
  std::setvbuf(stdout, nullptr, _IOLBF, BUFSIZ);
  try {
    Driver driver(read_address(words[1]), count == 3 ? words[2] : "C++");
    return driver.drive() ? 0 : 1;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "error: %s\n", error.what());
    return 2;
  }
}
