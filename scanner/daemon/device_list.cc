#include "scanner/daemon/device_list.h"

#include <nlohmann/json.hpp>
#include <utility>

#include "core/json.h"

namespace sateen {
namespace {

nlohmann::json DeviceJson(const DeviceReply& device) {
  nlohmann::json json = {
      {"port", device.port}, {"description", device.description}, {"what", device.what}};
  if (device.is_camera) {
    json["kind"] = "camera";
    json["ready"] = device.answers;
    if (device.answers) {
      json["model"] = device.model;
      json["profile"] = device.profile;
    }
    return json;
  }
  json["kind"] = device.answers ? "led-board" : "unknown";
  json["usb"] = device.usb.empty() ? nlohmann::json() : nlohmann::json(device.usb);
  json["serial"] = device.serial;
  if (device.answers) {
    json["firmware"] = device.firmware;
    json["protocol"] = device.protocol;
    json["lights"] = device.lights;
  }
  return json;
}

Result<DeviceReply> ReadDevice(JsonReader& json) {
  DeviceReply device = {.port = json.String("port"), .description = json.String("description")};
  device.what = json.String("what");
  const std::string kind = json.String("kind");
  device.is_camera = kind == "camera";
  json.Ignore("usb");
  if (device.is_camera) {
    device.answers = json.Boolean("ready");
    device.model = json.OptionalString("model").value_or("");
    device.profile = json.OptionalString("profile").value_or("");
  } else {
    device.answers = kind == "led-board";
    device.serial = json.String("serial");
    device.firmware = json.OptionalString("firmware").value_or("");
    device.protocol = json.OptionalString("protocol").value_or("");
    device.lights = json.OptionalInteger("lights").value_or(0);
  }
  const Status status = json.Finish();
  return status ? Result<DeviceReply>(std::move(device)) : tl::unexpected(status.error());
}

}  // namespace

DeviceReply ReplyOf(const SerialPortInfo& port) {
  return {.port = port.name,
          .usb = port.usb ? fmt::format("{:04x}:{:04x}", port.usb->vendor, port.usb->product) : "",
          .description = port.description,
          .serial = port.serial,
          .what = "not asked: not the USB id of an Arduino"};
}

DeviceReply ReplyOf(const UsbCamera& camera) {
  return {.port = camera.port,
          .description = camera.description,
          .is_camera = true,
          .what = camera.obstacle};
}

void TakeBoard(DeviceReply& reply, const BoardInfo& info, const Result<BoardReport>& report) {
  if (!report || report->state.lit != 0) {
    reply.what = report ? fmt::format(
                              "after 'hello', which turns everything off, it says: {} on; "
                              "look at the lights, and cut their supply if one is on",
                              LightsText(report->state.lit))
                        : report.error().message;
    return;
  }
  reply.answers = true;
  reply.firmware = info.build_id;
  reply.protocol = info.protocol;
  reply.lights = static_cast<int>(info.lights.size());
  reply.what = fmt::format("LED board, firmware {}, protocol {}, {} lights", info.build_id,
                           info.protocol, info.lights.size());
}

void TakeCamera(DeviceReply& reply, const CameraInfo& info) {
  reply.answers = true;
  reply.model = info.model;
  reply.profile = info.profile;
  reply.what = fmt::format("camera {}, profile {}, ready to capture", info.model, info.profile);
}

std::string DevicesJson(const std::vector<DeviceReply>& devices, int indent) {
  nlohmann::json json = {{"schema", "sateen.devices/1"}, {"devices", nlohmann::json::array()}};
  for (const DeviceReply& device : devices) {
    json["devices"].push_back(DeviceJson(device));
  }
  return JsonText(json, indent);
}

Result<std::vector<DeviceReply>> DevicesFromJson(const std::string& text) {
  const std::string where = "answer of the daemon";
  Result<nlohmann::json> parsed = ParseJson(text, where);
  if (!parsed) {
    return tl::unexpected(parsed.error());
  }
  if (const Status schema = TakeSchema(*parsed, where, "sateen.devices", 1); !schema) {
    return tl::unexpected(schema.error());
  }
  JsonReader json(*parsed, where);
  std::vector<DeviceReply> devices;
  for (JsonReader& found : json.Objects("devices")) {
    Result<DeviceReply> device = ReadDevice(found);
    if (!device) {
      return tl::unexpected(device.error());
    }
    // A text or null, which readers of optional texts refuse.
    const nlohmann::json usb = parsed->at("devices")[devices.size()].value("usb", nlohmann::json());
    device->usb = usb.is_string() ? usb.get<std::string>() : "";
    devices.push_back(*std::move(device));
  }
  const Status status = json.Finish();
  return status ? Result<std::vector<DeviceReply>>(std::move(devices))
                : tl::unexpected(status.error());
}

}  // namespace sateen
