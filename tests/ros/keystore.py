"""A keystore as `ros2 security create_keystore` and `create_enclave` make it: folders, names, kinds of keys, signatures."""

import datetime
import os
import pathlib

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import pkcs7

SCHEMA = 'xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" xsi:noNamespaceSchemaLocation=' \
    '"http://www.omg.org/spec/DDS-SECURITY/20170901/omg_shared_ca_'
ALL_TOPICS = ("rq/*Request", "rr/*Reply", "rt/*", "ros_discovery_info")
NOW = datetime.datetime.now(datetime.timezone.utc).replace(microsecond=0)
DAY = datetime.timedelta(days=1)


def governance(rtps="ENCRYPT", discovery="ENCRYPT", liveliness="ENCRYPT", metadata="ENCRYPT", data="NONE", access="true"):
    """The rules of SROS 2 for domain 0, but for `data`, which is ENCRYPT there."""
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<dds {SCHEMA}governance.xsd">
  <domain_access_rules>
    <domain_rule>
      <domains><id>0</id></domains>
      <allow_unauthenticated_participants>false</allow_unauthenticated_participants>
      <enable_join_access_control>true</enable_join_access_control>
      <discovery_protection_kind>{discovery}</discovery_protection_kind>
      <liveliness_protection_kind>{liveliness}</liveliness_protection_kind>
      <rtps_protection_kind>{rtps}</rtps_protection_kind>
      <topic_access_rules>
        <topic_rule>
          <topic_expression>*</topic_expression>
          <enable_discovery_protection>{str(discovery != "NONE").lower()}</enable_discovery_protection>
          <enable_liveliness_protection>{str(liveliness != "NONE").lower()}</enable_liveliness_protection>
          <enable_read_access_control>{access}</enable_read_access_control>
          <enable_write_access_control>{access}</enable_write_access_control>
          <metadata_protection_kind>{metadata}</metadata_protection_kind>
          <data_protection_kind>{data}</data_protection_kind>
        </topic_rule>
      </topic_access_rules>
    </domain_rule>
  </domain_access_rules>
</dds>
"""


def permissions(subject, publish=ALL_TOPICS, subscribe=ALL_TOPICS, until=NOW + 365 * DAY):
    def topics(names):
        return "<topics>" + "".join(f"<topic>{name}</topic>" for name in names) + "</topics>"

    return f"""<?xml version="1.0" encoding="UTF-8"?>
<dds {SCHEMA}permissions.xsd">
  <permissions>
    <grant name="{subject}">
      <subject_name>CN={subject}</subject_name>
      <validity>
        <not_before>{(NOW - 365 * DAY):%Y-%m-%dT%H:%M:%S}</not_before>
        <not_after>{until:%Y-%m-%dT%H:%M:%S}</not_after>
      </validity>
      <allow_rule>
        <domains><id>0</id></domains>
        <publish>{topics(publish)}</publish>
        <subscribe>{topics(subscribe)}</subscribe>
      </allow_rule>
      <default>DENY</default>
    </grant>
  </permissions>
</dds>
"""


class Authority:
    """Signs identities and documents."""

    def __init__(self, name="sros2CA"):
        self.key, self.certificate = certified(name)

    def sign(self, text):
        builder = pkcs7.PKCS7SignatureBuilder().set_data(text.encode())
        builder = builder.add_signer(self.certificate, self.key, hashes.SHA256())
        return builder.sign(serialization.Encoding.SMIME, [pkcs7.PKCS7Options.Text, pkcs7.PKCS7Options.DetachedSignature])


def certified(name, by=None, until=NOW + 365 * DAY):
    """A new key and its certificate, signed `by` an authority; without one it is an authority's own."""
    key = ec.generate_private_key(ec.SECP256R1())
    subject = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, name)])
    builder = x509.CertificateBuilder().subject_name(subject).issuer_name(by.certificate.subject if by else subject)
    builder = builder.public_key(key.public_key()).serial_number(x509.random_serial_number())
    builder = builder.not_valid_before(NOW - 365 * DAY).not_valid_after(until)
    basic = x509.BasicConstraints(ca=by is None, path_length=None if by else 1)
    builder = builder.add_extension(basic, critical=by is None)
    return key, builder.sign(by.key if by else key, hashes.SHA256())


def pem(thing):
    if isinstance(thing, x509.Certificate):
        return thing.public_bytes(serialization.Encoding.PEM)
    return thing.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption())


class Keystore:
    """In `folder`; what an enclave shares with the others is linked into it, as SROS 2 does it."""

    def __init__(self, folder, **rules):
        self.folder, self.authority = pathlib.Path(folder), Authority()
        for part in ("public", "enclaves"):
            (self.folder / part).mkdir(parents=True)
        for name in ("identity_ca.cert.pem", "permissions_ca.cert.pem"):
            (self.folder / "public" / name).write_bytes(pem(self.authority.certificate))
        (self.folder / "enclaves" / "governance.p7s").write_bytes(self.authority.sign(governance(**rules)))

    def enclave(self, name, **grants):
        """Makes the enclave and returns its folder."""
        folder = self.folder / "enclaves" / name.lstrip("/")
        folder.mkdir(parents=True, exist_ok=True)
        shared = ("public/identity_ca.cert.pem", "public/permissions_ca.cert.pem", "enclaves/governance.p7s")
        for path in shared:
            link = folder / pathlib.PurePath(path).name
            link.symlink_to(os.path.relpath(self.folder / path, folder))
        key, certificate = certified(name, self.authority)
        (folder / "key.pem").write_bytes(pem(key))
        (folder / "cert.pem").write_bytes(pem(certificate))
        (folder / "permissions.p7s").write_bytes(self.authority.sign(permissions(name, **grants)))
        return folder

    def variables(self, strategy="Enforce"):
        """What a user exports."""
        return {"ROS_SECURITY_ENABLE": "true", "ROS_SECURITY_STRATEGY": strategy, "ROS_SECURITY_KEYSTORE": str(self.folder)}
