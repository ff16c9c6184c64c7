#include "scanner/capture_request.h"

namespace sateen {

Result<CaptureSummary> RunCapture(const CaptureRequest& request, RigDevices& devices,
                                  const Task& task, const CaptureObserver& /*observer*/) {
  Result<CaptureSession> session =
      request.resume ? CaptureSession::Resume(request.output, request.options)
                     : CaptureSession::Begin(request.output, request.rig, request.options);
  if (!session) {
    return tl::unexpected(session.error());
  }
  const Result<TetheredCamera*> camera = devices.Camera();
  if (!camera) {
    return tl::unexpected(camera.error());
  }
  const Result<LightBoard*> board = devices.Board();
  if (!board) {
    return tl::unexpected(board.error());
  }
  return session->Run(**board, **camera, task);
}

}  // namespace sateen
