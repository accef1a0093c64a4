include "camera.thrift"

struct Matrix {} (yarp.name = "yarp::sig::Matrix")
/** A list of a number that counts, and a time in s. */
struct Stamp {} (yarp.name = "yarp::os::Stamp")
struct DepthImage {} (yarp.name = "yarp::sig::ImageOf<yarp::sig::PixelFloat>")
enum SensorStatus {} (yarp.name = "yarp::dev::IRGBDSensor::RGBDSensor_status")

struct return_getExtrinsicParam { 1: camera.ReturnValue ret; 2: Matrix matrix }
struct return_getLastErrorMsg { 1: camera.ReturnValue ret; 2: string text; 3: Stamp stamp }
struct return_getRgbImage { 1: camera.ReturnValue ret; 2: camera.Image image; 3: Stamp stamp }
struct return_getDepthImage { 1: camera.ReturnValue ret; 2: DepthImage image; 3: Stamp stamp }
struct return_getImages { 1: camera.ReturnValue ret; 2: camera.Image colour; 3: DepthImage depth; 4: Stamp colour_time; 5: Stamp depth_time }
struct return_getSensorStatus { 1: camera.ReturnValue ret; 2: SensorStatus status }
struct return_getDepthWidth { 1: camera.ReturnValue ret; 2: i32 width }
struct return_getDepthHeight { 1: camera.ReturnValue ret; 2: i32 height }
struct return_getDepthResolution { 1: camera.ReturnValue ret; 2: i32 width; 3: i32 height }
struct return_getDepthFOV { 1: camera.ReturnValue ret; 2: double horizontal; 3: double vertical }
struct return_getDepthIntrinsicParam { 1: camera.ReturnValue ret; 2: camera.Property parameters }
struct return_getDepthMirroring { 1: camera.ReturnValue ret; 2: bool value }
struct return_getDepthAccuracy { 1: camera.ReturnValue ret; 2: double value }
struct return_getDepthClipPlanes { 1: camera.ReturnValue ret; 2: double near; 3: double far }

/**
 * The functions of a depth camera of YARP 4.0, at the port NAME/rpc:i.
 */
service RGBDSensorMsgs extends camera.FrameGrabberControls {
  /** Return the transformation from the colour camera to the depth camera, of 4 x 4 numbers. */
  return_getExtrinsicParam getExtrinsicParamRPC();
  /** Return the text of the last error, and its time. */
  return_getLastErrorMsg getLastErrorMsgRPC();
  /** Return the picture in colours, and its time. */
  return_getRgbImage getRgbImageRPC();
  /** Return the picture of distances in m, and its time. */
  return_getDepthImage getDepthImageRPC();
  /** Return both pictures and their times. */
  return_getImages getImagesRPC();
  /** Return whether the sensor works. */
  return_getSensorStatus getSensorStatusRPC();
  /** Return the pixels per row. */
  camera.return_getRgbWidth getRgbWidthRPC();
  /** Return the number of rows. */
  camera.return_getRgbHeight getRgbHeightRPC();
  /** Return width and height. */
  camera.return_getRgbResolution getRgbResolutionRPC();
  /** Set width and height; RTF's cameras refuse it. */
  camera.ReturnValue setRgbResolutionRPC(1: i32 width, 2: i32 height);
  /** Return the horizontal and the vertical field of view. */
  camera.return_getRgbFOV getRgbFOVRPC();
  /** Set the field of view; RTF's cameras refuse it. */
  camera.ReturnValue setRgbFOVRPC(1: double horizontal, 2: double vertical);
  /** Return the intrinsic parameters. */
  camera.return_getRgbIntrinsicParam getRgbIntrinsicParamRPC();
  /** Return whether the picture is mirrored. */
  camera.return_getRgbMirroring getRgbMirroringRPC();
  /** Mirror the picture, or not; RTF's cameras refuse it. */
  camera.ReturnValue setRgbMirroringRPC(1: bool value);
  /** Return the possible sizes and rates of pictures; RTF's cameras do not have it. */
  camera.return_getRgbSupportedConfigurations getRgbSupportedConfigurationsRPC();
  /** Return the pixels per row. */
  return_getDepthWidth getDepthWidthRPC();
  /** Return the number of rows. */
  return_getDepthHeight getDepthHeightRPC();
  /** Return width and height. */
  return_getDepthResolution getDepthResolutionRPC();
  /** Set width and height; RTF's cameras refuse it. */
  camera.ReturnValue setDepthResolutionRPC(1: i32 width, 2: i32 height);
  /** Return the horizontal and the vertical field of view. */
  return_getDepthFOV getDepthFOVRPC();
  /** Set the field of view; RTF's cameras refuse it. */
  camera.ReturnValue setDepthFOVRPC(1: double horizontal, 2: double vertical);
  /** Return the intrinsic parameters. */
  return_getDepthIntrinsicParam getDepthIntrinsicParamRPC();
  /** Return whether the picture is mirrored. */
  return_getDepthMirroring getDepthMirroringRPC();
  /** Mirror the picture, or not; RTF's cameras refuse it. */
  camera.ReturnValue setDepthMirroringRPC(1: bool value);
  /** Return the accuracy of a distance in m. */
  return_getDepthAccuracy getDepthAccuracyRPC();
  /** Set the accuracy; RTF's cameras refuse it. */
  camera.ReturnValue setDepthAccuracyRPC(1: double value);
  /** Return the least and the greatest distance in m. */
  return_getDepthClipPlanes getDepthClipPlanesRPC();
  /** Set the least and the greatest distance; RTF's cameras refuse it. */
  camera.ReturnValue setDepthClipPlanesRPC(1: double near, 2: double far);
}
