/** How a call ended: a list of [ok], or of the word of an error. */
struct ReturnValue {} (yarp.name = "yarp::dev::ReturnValue")
struct Image {} (yarp.name = "yarp::sig::FlexImage")
struct Property {} (yarp.name = "yarp::os::Property")
/** A list of width, height, frames a second, and the encoding of the pixels. */
struct CameraConfiguration {} (yarp.name = "yarp::dev::CameraConfig")
/** A list of column and row. */
struct Corner {} (yarp.name = "yarp::dev::vertex_t")
enum CropType {} (yarp.name = "yarp::dev::cropType_id_t")
enum FeatureMode {} (yarp.name = "yarp::dev::FeatureMode")
/** What can be set at a camera. */
typedef i32 CameraFeature

struct return_getHeight { 1: ReturnValue ret; 2: i32 height }
struct return_getWidth { 1: ReturnValue ret; 2: i32 width }
struct return_getImage { 1: ReturnValue ret; 2: Image image }
struct return_getImageCrop { 1: ReturnValue ret; 2: Image image }
struct return_getRgbWidth { 1: ReturnValue ret; 2: i32 width }
struct return_getRgbHeight { 1: ReturnValue ret; 2: i32 height }
struct return_getRgbSupportedConfigurations { 1: ReturnValue ret; 2: list<CameraConfiguration> configurations }
struct return_getRgbResolution { 1: ReturnValue ret; 2: i32 width; 3: i32 height }
struct return_getRgbFOV { 1: ReturnValue ret; 2: double horizontal; 3: double vertical }
struct return_getRgbIntrinsicParam { 1: ReturnValue ret; 2: Property parameters }
struct return_getRgbMirroring { 1: ReturnValue ret; 2: bool value }
struct return_getCameraDescription { 1: ReturnValue ret; 2: i32 bus; 3: string description }
struct return_hasFeature { 1: ReturnValue ret; 2: bool value }
struct return_getFeature1 { 1: ReturnValue ret; 2: double value }
struct return_getFeature2 { 1: ReturnValue ret; 2: double value1; 3: double value2 }
struct return_hasOnOff { 1: ReturnValue ret; 2: bool value }
struct return_getActive { 1: ReturnValue ret; 2: bool value }
struct return_hasAuto { 1: ReturnValue ret; 2: bool value }
struct return_hasManual { 1: ReturnValue ret; 2: bool value }
struct return_hasOnePush { 1: ReturnValue ret; 2: bool value }
struct return_getMode { 1: ReturnValue ret; 2: FeatureMode mode }
struct return_getVideoModeMaskDC1394 { 1: ReturnValue ret; 2: i32 value }
struct return_getVideoModeDC1394 { 1: ReturnValue ret; 2: i32 value }
struct return_getFPSMaskDC1394 { 1: ReturnValue ret; 2: i32 value }
struct return_getFPSDC1394 { 1: ReturnValue ret; 2: i32 value }
struct return_getISOSpeedDC1394 { 1: ReturnValue ret; 2: i32 value }
struct return_getColorCodingMaskDC1394 { 1: ReturnValue ret; 2: i32 value }
struct return_getColorCodingDC1394 { 1: ReturnValue ret; 2: i32 value }
struct return_getFormat7MaxWindowDC1394 { 1: ReturnValue ret; 2: i32 width; 3: i32 height; 4: i32 width_step; 5: i32 height_step; 6: i32 x_step; 7: i32 y_step }
struct return_getFormat7WindowDC1394 { 1: ReturnValue ret; 2: i32 width; 3: i32 height; 4: i32 x; 5: i32 y }
struct return_getOperationModeDC1394 { 1: ReturnValue ret; 2: bool value }
struct return_getTransmissionDC1394 { 1: ReturnValue ret; 2: bool value }
struct return_getBytesPerPacketDC1394 { 1: ReturnValue ret; 2: i32 value }

/** What can be set at a camera: brightness, exposure, white balance, and others. */
service FrameGrabberControls {
  /** Return the kind of bus, and a text. */
  return_getCameraDescription getCameraDescriptionRPC();
  /** Return whether the camera has a feature. */
  return_hasFeature hasFeatureRPC(1: CameraFeature feature);
  /** Set the value of a feature. */
  ReturnValue setFeature1RPC(1: CameraFeature feature, 2: double value);
  /** Return the value of a feature; two values for the white balance. */
  return_getFeature1 getFeature1RPC(1: CameraFeature feature);
  /** Set the value of a feature. */
  ReturnValue setFeature2RPC(1: CameraFeature feature, 2: double value1, 3: double value2);
  /** Return the values of a feature that has two. */
  return_getFeature2 getFeature2RPC(1: CameraFeature feature);
  /** Return whether a feature can be switched on and off. */
  return_hasOnOff hasOnOffRPC(1: CameraFeature feature);
  /** Switch a feature on or off. */
  ReturnValue setActiveRPC(1: CameraFeature feature, 2: bool value);
  /** Return whether a feature is switched on. */
  return_getActive getActiveRPC(1: CameraFeature feature);
  /** Return whether the camera can control a feature automatically. */
  return_hasAuto hasAutoRPC(1: CameraFeature feature);
  /** Return whether the camera has a feature. */
  return_hasManual hasManualRPC(1: CameraFeature feature);
  /** Return whether the camera can adjust a feature once: False, these interfaces have no way to ask for it. */
  return_hasOnePush hasOnePushRPC(1: CameraFeature feature);
  /** Set by whom a feature is set. */
  ReturnValue setModeRPC(1: CameraFeature feature, 2: FeatureMode mode);
  /** Return by whom a feature is set. */
  return_getMode getModeRPC(1: CameraFeature feature);
  /** Refuse: these interfaces have no way to let the camera adjust a feature once. */
  ReturnValue setOnePushRPC(1: CameraFeature feature);
}

/**
 * The functions of a camera of YARP 4.0, at the port NAME/rpc. Angles are in degrees, lengths of images in pixels.
 */
service FrameGrabberMsgs extends FrameGrabberControls {
  /** Return the number of rows. */
  return_getHeight getHeightRPC();
  /** Return the pixels per row. */
  return_getWidth getWidthRPC();
  /** Return the image in colours. */
  return_getImage getImageRPC();
  /** Return the part of the colour image between two corners, inclusive. */
  return_getImageCrop getImageCropRPC(1: CropType type, 2: list<Corner> corners);
  /** Return the pixels per row. */
  return_getRgbWidth getRgbWidthRPC();
  /** Return the number of rows. */
  return_getRgbHeight getRgbHeightRPC();
  /** Return the possible sizes and rates of images: the present one. */
  return_getRgbSupportedConfigurations getRgbSupportedConfigurationsRPC();
  /** Return width and height. */
  return_getRgbResolution getRgbResolutionRPC();
  /** Refuse: these interfaces have no way to set it. */
  ReturnValue setRgbResolutionRPC(1: i32 width, 2: i32 height);
  /** Return the horizontal and the vertical field of view in deg. */
  return_getRgbFOV getRgbFOVRPC();
  /** Refuse: these interfaces have no way to set it. */
  ReturnValue setRgbFOVRPC(1: double horizontal, 2: double vertical);
  /** Return the intrinsic parameters; lengths in pixels. matrix is the name of one of them. */
  return_getRgbIntrinsicParam getRgbIntrinsicParamRPC();
  /** Return whether the image is mirrored. */
  return_getRgbMirroring getRgbMirroringRPC();
  /** Mirror the image, or not. */
  ReturnValue setRgbMirroringRPC(1: bool value);
  return_getVideoModeMaskDC1394 getVideoModeMaskDC1394RPC();
  return_getVideoModeDC1394 getVideoModeDC1394RPC();
  ReturnValue setVideoModeDC1394RPC(1: i32 value);
  return_getFPSMaskDC1394 getFPSMaskDC1394RPC();
  return_getFPSDC1394 getFPSDC1394RPC();
  ReturnValue setFPSDC1394RPC(1: i32 value);
  return_getISOSpeedDC1394 getISOSpeedDC1394RPC();
  ReturnValue setISOSpeedDC1394RPC(1: i32 value);
  return_getColorCodingMaskDC1394 getColorCodingMaskDC1394RPC(1: i32 value);
  return_getColorCodingDC1394 getColorCodingDC1394RPC();
  ReturnValue setColorCodingDC1394RPC(1: i32 value);
  return_getFormat7MaxWindowDC1394 getFormat7MaxWindowDC1394RPC();
  return_getFormat7WindowDC1394 getFormat7WindowDC1394RPC();
  ReturnValue setFormat7WindowDC1394RPC(1: i32 width, 2: i32 height, 3: i32 x, 4: i32 y);
  ReturnValue setOperationModeDC1394RPC(1: bool value);
  return_getOperationModeDC1394 getOperationModeDC1394RPC();
  ReturnValue setTransmissionDC1394RPC(1: bool value);
  return_getTransmissionDC1394 getTransmissionDC1394RPC();
  ReturnValue setBroadcastDC1394RPC(1: bool value);
  ReturnValue setDefaultsDC1394RPC();
  ReturnValue setResetDC1394RPC();
  ReturnValue setPowerDC1394RPC(1: bool value);
  ReturnValue setCaptureDC1394RPC(1: bool value);
  return_getBytesPerPacketDC1394 getBytesPerPacketDC1394RPC();
  ReturnValue setBytesPerPacketDC1394RPC(1: i32 value);
}
