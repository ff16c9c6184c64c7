#include "scanner/camera_worker/gphoto_session.h"

#include <fcntl.h>
#include <gphoto2/gphoto2.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <memory>
#include <nlohmann/json.hpp>
#include <string_view>
#include <thread>
#include <vector>

namespace sateen {
namespace {

using nlohmann::json;
using std::chrono::milliseconds;
using std::chrono::steady_clock;

template <typename T, int (*Free)(T*)>
struct Freer {
  void operator()(T* object) const { Free(object); }
};
using WidgetPtr = std::unique_ptr<CameraWidget, Freer<CameraWidget, gp_widget_free>>;
using FilePtr = std::unique_ptr<CameraFile, Freer<CameraFile, gp_file_unref>>;
using ListPtr = std::unique_ptr<CameraList, Freer<CameraList, gp_list_free>>;

// A card with less has no room for another RAW file. [KB]
constexpr uint64_t kLeastRoomKb = 64ULL * 1024;

int MillisecondsSince(steady_clock::time_point start) {
  return static_cast<int>(
      std::chrono::duration_cast<milliseconds>(steady_clock::now() - start).count());
}

void KeepWords(GPContext* /*context*/, const char* text, void* words) {
  *static_cast<std::string*>(words) = text;
}

// Finds "PTP/IP Camera" for network ports, and for USB whatever is at the port.
int FindAbilities(const std::string& port, GPPortInfoList* ports, GPContext* context,
                  CameraAbilities& abilities) {
  CameraAbilitiesList* all = nullptr;
  int code = gp_abilities_list_new(&all);
  if (code >= GP_OK) {
    code = gp_abilities_list_load(all, context);
  }
  std::string model = "PTP/IP Camera";
  if (code >= GP_OK && port.rfind("ptpip:", 0) != 0) {
    CameraList* raw = nullptr;
    gp_list_new(&raw);
    const ListPtr found(raw);
    code = gp_abilities_list_detect(all, ports, found.get(), context);
    model.clear();
    for (int k = 0; code >= GP_OK && k < gp_list_count(found.get()); ++k) {
      const char* name = nullptr;
      const char* place = nullptr;
      gp_list_get_name(found.get(), k, &name);
      gp_list_get_value(found.get(), k, &place);
      if (place != nullptr && name != nullptr && port == place) {
        model = name;
      }
    }
  }
  if (code >= GP_OK) {
    code = model.empty() ? GP_ERROR_MODEL_NOT_FOUND
                         : gp_abilities_list_lookup_model(all, model.c_str());
  }
  if (code >= GP_OK) {
    code = gp_abilities_list_get_abilities(all, code, &abilities);
  }
  gp_abilities_list_free(all);
  return code;
}

// Returns the errno of creating or writing the file; 0 if all of it is there.
int WriteNewFile(const std::string& path, std::string_view bytes) {
  const int descriptor = open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
  if (descriptor < 0) {
    return errno;
  }
  int failed = 0;
  while (!bytes.empty() && failed == 0) {
    const ssize_t count = write(descriptor, bytes.data(), bytes.size());
    failed = count < 0 && errno != EINTR ? errno : 0;
    bytes.remove_prefix(count > 0 ? static_cast<size_t>(count) : 0);
  }
  // Over a network the disk may say only now that it is full.
  if (close(descriptor) != 0 && failed == 0) {
    failed = errno;
  }
  return failed;
}

}  // namespace

GphotoSession::GphotoSession() : context_(gp_context_new()) {
  gp_context_set_error_func(context_, KeepWords, &words_);
}

GphotoSession::~GphotoSession() {
  Close();
  gp_context_unref(context_);
}

json GphotoSession::Failure(int code, const std::string& during) {
  std::string text = gp_result_as_string(code);
  if (!words_.empty()) {
    text += " (" + words_ + ")";
  }
  words_.clear();
  return {{"error", {{"code", code}, {"text", text}, {"while", during}}}};
}

json GphotoSession::Refuse(const Error& error) {
  return {{"error",
           {{"code", GP_ERROR_BAD_PARAMETERS},
            {"text", error.message},
            {"while", "reading a request"}}}};
}

json GphotoSession::Do(const json& request) {
  const std::string verb = request.value("do", "");
  const std::string name = request.value("name", "");
  const std::string folder = request.value("folder", "");
  if (verb == "list") {
    return List();
  }
  if (verb == "open") {
    return Open(request.value("port", ""), request.value("settle_ms", 0));
  }
  if (verb == "close") {
    return Close();
  }
  if (camera_ == nullptr) {
    return Failure(GP_ERROR_BAD_PARAMETERS, verb + " before open");
  }
  if (verb == "get") {
    return Get(name);
  }
  if (verb == "set") {
    return Set(name, request.value("value", ""));
  }
  if (verb == "trigger") {
    return Trigger(request.value("wait_ms", 0));
  }
  if (verb == "await") {
    return Await(request.value("wait_ms", 0));
  }
  if (verb == "info") {
    return Info(folder, name);
  }
  if (verb == "download") {
    return Download(folder, name, request.value("path", ""));
  }
  if (verb == "delete") {
    return Delete(folder, name);
  }
  return Failure(GP_ERROR_NOT_SUPPORTED, verb);
}

json GphotoSession::List() {
  CameraList* raw = nullptr;
  gp_list_new(&raw);
  const ListPtr found(raw);
  if (const int code = gp_camera_autodetect(found.get(), context_); code < GP_OK) {
    return Failure(code, "looking for cameras");
  }
  json cameras = json::array();
  for (int k = 0; k < gp_list_count(found.get()); ++k) {
    const char* model = "";
    const char* port = "";
    gp_list_get_name(found.get(), k, &model);
    gp_list_get_value(found.get(), k, &port);
    cameras.push_back({{"model", model}, {"port", port}});
  }
  return {{"cameras", cameras}};
}

json GphotoSession::Open(const std::string& port, int settle_ms) {
  Close();
  GPPortInfoList* ports = nullptr;
  gp_port_info_list_new(&ports);
  int code = gp_port_info_list_load(ports);
  GPPortInfo info = nullptr;
  if (code >= GP_OK) {
    code = gp_port_info_list_lookup_path(ports, port.c_str());
  }
  if (code >= GP_OK) {
    code = gp_port_info_list_get_info(ports, code, &info);
  }
  CameraAbilities abilities = {};
  if (code >= GP_OK) {
    code = FindAbilities(port, ports, context_, abilities);
  }
  if (code >= GP_OK) {
    gp_camera_new(&camera_);
    gp_camera_set_abilities(camera_, abilities);
    gp_camera_set_port_info(camera_, info);
    code = gp_camera_init(camera_, context_);
  }
  gp_port_info_list_free(ports);
  if (code < GP_OK) {
    if (camera_ != nullptr) {
      gp_camera_unref(camera_);
      camera_ = nullptr;
    }
    return Failure(code, "connecting to the camera");
  }
  const auto start = steady_clock::now();
  while (MillisecondsSince(start) < settle_ms) {
    if (json thrown_away = Await(settle_ms - MillisecondsSince(start));
        thrown_away.contains("error")) {
      return thrown_away;
    }
  }
  return json::object();
}

json GphotoSession::Get(const std::string& name) {
  CameraWidget* raw = nullptr;
  const int code = gp_camera_get_single_config(camera_, name.c_str(), &raw, context_);
  if (code == GP_ERROR_BAD_PARAMETERS) {
    words_.clear();
    return {{"absent", true}};
  }
  if (code < GP_OK) {
    return Failure(code, "reading " + name);
  }
  const WidgetPtr widget(raw);
  CameraWidgetType type = GP_WIDGET_TEXT;
  gp_widget_get_type(raw, &type);
  int readonly = 0;
  gp_widget_get_readonly(raw, &readonly);
  json answer = {{"readonly", readonly != 0}, {"choices", json::array()}};
  if (type == GP_WIDGET_RADIO || type == GP_WIDGET_MENU || type == GP_WIDGET_TEXT) {
    const char* value = nullptr;
    gp_widget_get_value(raw, &value);
    answer["value"] = value != nullptr ? value : "";
    for (int k = 0; type != GP_WIDGET_TEXT && k < gp_widget_count_choices(raw); ++k) {
      const char* choice = nullptr;
      gp_widget_get_choice(raw, k, &choice);
      answer["choices"].push_back(choice != nullptr ? choice : "");
    }
  } else if (type == GP_WIDGET_TOGGLE) {
    int value = 0;
    gp_widget_get_value(raw, &value);
    answer["value"] = value == 0 ? "off" : "on";
  } else {
    return {{"absent", true}};  // nothing that Sateen sets is a range, a date or a button
  }
  return answer;
}

json GphotoSession::Set(const std::string& name, const std::string& value) {
  CameraWidget* raw = nullptr;
  int code = gp_camera_get_single_config(camera_, name.c_str(), &raw, context_);
  if (code >= GP_OK) {
    const WidgetPtr widget(raw);
    CameraWidgetType type = GP_WIDGET_TEXT;
    gp_widget_get_type(raw, &type);
    const int toggle = value == "on" ? 1 : 0;
    const void* to_set = value.c_str();
    if (type == GP_WIDGET_TOGGLE) {
      to_set = &toggle;
    }
    code = gp_widget_set_value(raw, to_set);
    if (code >= GP_OK) {
      code = gp_camera_set_single_config(camera_, name.c_str(), raw, context_);
    }
  }
  return code < GP_OK ? Failure(code, "setting " + name + " to " + value) : json::object();
}

// Returns whether the card has room, or true if that is not known. On a full card libgphoto2 says
// no more of some cameras, Nikon's, than that a capture has failed.
bool GphotoSession::CardHasRoom() {
  CameraStorageInformation* raw = nullptr;
  int count = 0;
  if (gp_camera_get_storageinfo(camera_, &raw, &count, context_) < GP_OK) {
    return true;  // nothing is known
  }
  const std::unique_ptr<CameraStorageInformation, decltype(&std::free)> owner(raw, &std::free);
  bool known = false;
  bool room = false;
  for (int k = 0; k < count; ++k) {
    known |= (raw[k].fields & GP_STORAGEINFO_FREESPACEKBYTES) != 0;
    room |= raw[k].freekbytes >= kLeastRoomKb;
  }
  return room || !known;
}

json GphotoSession::Trigger(int wait_ms) {
  const auto start = steady_clock::now();
  while (true) {
    const int after_ms = MillisecondsSince(start);
    const int code = gp_camera_trigger_capture(camera_, context_);
    if (code >= GP_OK) {
      return {{"after_ms", after_ms}};
    }
    if (code != GP_ERROR_CAMERA_BUSY || MillisecondsSince(start) >= wait_ms) {
      json failure = Failure(code, "taking a frame");
      if (code == GP_ERROR && !CardHasRoom()) {
        failure["error"]["code"] = GP_ERROR_NO_SPACE;
      }
      words_.clear();
      return failure;
    }
    words_.clear();
    std::this_thread::sleep_for(milliseconds(20));
  }
}

json GphotoSession::Await(int wait_ms) {
  const auto start = steady_clock::now();
  do {
    CameraEventType type = GP_EVENT_TIMEOUT;
    void* data = nullptr;
    const int left = std::max(wait_ms - MillisecondsSince(start), 1);
    const int code = gp_camera_wait_for_event(camera_, std::min(left, 100), &type, &data, context_);
    const std::unique_ptr<void, decltype(&std::free)> owner(data, &std::free);
    if (code < GP_OK) {
      return Failure(code, "waiting for the file");
    }
    if (type == GP_EVENT_FILE_ADDED) {
      const auto* path = static_cast<const CameraFilePath*>(data);
      return {{"folder", path->folder}, {"name", path->name}};
    }
  } while (MillisecondsSince(start) < wait_ms);
  return json::object();
}

json GphotoSession::Info(const std::string& folder, const std::string& name) {
  CameraFileInfo info = {};
  const int code = gp_camera_file_get_info(camera_, folder.c_str(), name.c_str(), &info, context_);
  if (code < GP_OK) {
    return Failure(code, "asking for the size of " + name);
  }
  if ((info.file.fields & GP_FILE_INFO_SIZE) == 0) {
    return json::object();
  }
  return {{"bytes", info.file.size}};
}

// Downloads by way of memory, because the library does not tell why it cannot write a file.
json GphotoSession::Download(const std::string& folder, const std::string& name,
                             const std::string& path) {
  CameraFile* raw = nullptr;
  if (const int code = gp_file_new(&raw); code < GP_OK) {
    return Failure(code, "downloading " + name);
  }
  const FilePtr file(raw);
  int code = gp_camera_file_get(camera_, folder.c_str(), name.c_str(), GP_FILE_TYPE_NORMAL,
                                file.get(), context_);
  const char* bytes = nullptr;
  unsigned long size = 0;
  if (code >= GP_OK) {
    code = gp_file_get_data_and_size(file.get(), &bytes, &size);
  }
  if (code < GP_OK) {
    return Failure(code, "downloading " + name);
  }
  if (const int failed = WriteNewFile(path, {bytes, size}); failed != 0) {
    return {{"error", {{"errno", failed}, {"path", path}}}};
  }
  return json::object();
}

json GphotoSession::Delete(const std::string& folder, const std::string& name) {
  const int code = gp_camera_file_delete(camera_, folder.c_str(), name.c_str(), context_);
  return code < GP_OK ? Failure(code, "deleting " + name + " from the camera") : json::object();
}

json GphotoSession::Close() {
  if (camera_ != nullptr) {
    gp_camera_exit(camera_, context_);
    gp_camera_unref(camera_);
    camera_ = nullptr;
  }
  return json::object();
}

}  // namespace sateen
