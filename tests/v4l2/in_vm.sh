# Runs inside the virtual machine: every check, and the faults that vivid injects while frames stream.
# vivid.ko's input 0 is a webcam (640x480 at 25 fps here); its controls stay set over opens.
set -u
failed=0
control="v4l2-ctl -d /dev/video0 -c"
check() {  # TITLE COMMAND...
  echo "--- $1"
  shift
  "$@" || { echo "FAILED with status $?"; failed=1; }
  wait
}
after() {  # SECONDS COMMAND: beside the check that follows
  (sleep "$1"; shift; "$@") &
}

check "every supported format" capture_check /dev/video0 formats "${FRAMES:-100}" YUYV UYVY NV12 GREY Y16
after 1 $control percentage_of_dropped_buffers=30
check "30 % of the buffers dropped" capture_check /dev/video0 fault 60 dropped
$control percentage_of_dropped_buffers=0
after 1 $control inject_v4l2_buf_flag_error=1
check "a buffer flagged as damaged" capture_check /dev/video0 fault 60 damaged
after 1 $control disconnect=1
check "disconnected in mid-stream" capture_check /dev/video0 fault 60 restarts
after 1 $control inject_fatal_streaming_error=1
check "fatal streaming error" capture_check /dev/video0 fault 60 restarts
after 1 $control inject_vidioc_qbuf_error=1
check "QBUF fails" capture_check /dev/video0 fault 60 restarts
$control wrap_sequence_number=1
check "sequence numbers wrap" capture_check /dev/video0 fault 140 none
$control wrap_sequence_number=0
$control inject_vidioc_streamon_error=1
check "STREAMON fails" capture_check /dev/video0 refused
$control inject_vidioc_reqbufs_error=1
check "REQBUFS fails" capture_check /dev/video0 refused
check "opened again after both" capture_check /dev/video0 fault 20 none
capture_check /dev/video0 fault 120 none > /tmp/first &
sleep 1.5
check "a second reader" capture_check /dev/video0 refused
cat /tmp/first; grep -q ^passed /tmp/first || failed=1
after 1 sh -c 'echo vivid.0 >/sys/bus/platform/drivers/vivid/unbind; sleep 2; echo vivid.0 >/sys/bus/platform/drivers/vivid/bind'
check "unplugged for two seconds" capture_check /dev/video0 fault 60 restarts
after 1 sh -c 'echo vivid.0 >/sys/bus/platform/drivers/vivid/unbind'
check "unplugged for good" capture_check /dev/video0 lost
exit $failed
