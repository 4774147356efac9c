#!/bin/sh
# Makes a keystore like 'ros2 security create_keystore' and 'create_enclave', using only openssl.
#   keystore.sh FOLDER ENCLAVE[=TOPIC,TOPIC...] ...
# ENCLAVE is a name such as /robot. It may use all topics, or only the given DDS topics (rt/chatter; * stands for any).
# Governance as SROS2 writes it: everything is encrypted, and nobody joins without a certificate.
set -eu
keystore=$1
shift
schema="http://www.omg.org/spec/DDS-SECURITY/20170901"
mkdir -p "$keystore/public" "$keystore/private" "$keystore/enclaves"
quiet() { "$@" 2>"$keystore/openssl.log" || { cat "$keystore/openssl.log" >&2; exit 1; }; }
sign() {
  quiet openssl smime -sign -text -in "$1" -out "$2" -signer "$keystore/public/ca.cert.pem" -inkey "$keystore/private/ca.key.pem"
}

if [ ! -e "$keystore/public/ca.cert.pem" ]; then
  quiet openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -sha256 -days 3650 -subj "/CN=sros2CA" \
    -keyout "$keystore/private/ca.key.pem" -out "$keystore/public/ca.cert.pem"
  cat >"$keystore/enclaves/governance.xml" <<END
<?xml version="1.0" encoding="UTF-8"?>
<dds xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" xsi:noNamespaceSchemaLocation="$schema/omg_shared_ca_governance.xsd">
  <domain_access_rules>
    <domain_rule>
      <domains><id_range><min>0</min><max>232</max></id_range></domains>
      <allow_unauthenticated_participants>false</allow_unauthenticated_participants>
      <enable_join_access_control>true</enable_join_access_control>
      <discovery_protection_kind>ENCRYPT</discovery_protection_kind>
      <liveliness_protection_kind>ENCRYPT</liveliness_protection_kind>
      <rtps_protection_kind>SIGN</rtps_protection_kind>
      <topic_access_rules>
        <topic_rule>
          <topic_expression>*</topic_expression>
          <enable_discovery_protection>true</enable_discovery_protection>
          <enable_liveliness_protection>true</enable_liveliness_protection>
          <enable_read_access_control>true</enable_read_access_control>
          <enable_write_access_control>true</enable_write_access_control>
          <metadata_protection_kind>ENCRYPT</metadata_protection_kind>
          <data_protection_kind>ENCRYPT</data_protection_kind>
        </topic_rule>
      </topic_access_rules>
    </domain_rule>
  </domain_access_rules>
</dds>
END
  sign "$keystore/enclaves/governance.xml" "$keystore/enclaves/governance.p7s"
fi

for enclave; do
  name=${enclave%%=*} topics=""
  case $enclave in *=*) allowed=${enclave#*=} ;; *) allowed="*" ;; esac
  folder=$keystore/enclaves$name
  mkdir -p "$folder"
  set -f
  for topic in $(echo "$allowed" | tr , ' '); do topics="$topics<topic>$topic</topic>"; done
  set +f
  quiet openssl req -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -sha256 \
    -subj "/CN=$(echo "$name" | sed 's#/#\\/#g')" -keyout "$folder/key.pem" -out "$folder/request.pem"
  quiet openssl x509 -req -sha256 -days 3650 -in "$folder/request.pem" -CA "$keystore/public/ca.cert.pem" \
    -CAkey "$keystore/private/ca.key.pem" -CAcreateserial -out "$folder/cert.pem"
  rm "$folder/request.pem"
  cat >"$folder/permissions.xml" <<END
<?xml version="1.0" encoding="UTF-8"?>
<dds xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" xsi:noNamespaceSchemaLocation="$schema/omg_shared_ca_permissions.xsd">
  <permissions>
    <grant name="$name">
      <subject_name>CN=$name</subject_name>
      <validity><not_before>2020-01-01T00:00:00</not_before><not_after>2100-01-01T00:00:00</not_after></validity>
      <allow_rule>
        <domains><id_range><min>0</min><max>232</max></id_range></domains>
        <publish><topics>$topics</topics></publish>
        <subscribe><topics>$topics</topics></subscribe>
      </allow_rule>
      <default>DENY</default>
    </grant>
  </permissions>
</dds>
END
  sign "$folder/permissions.xml" "$folder/permissions.p7s"
  cp "$keystore/public/ca.cert.pem" "$folder/identity_ca.cert.pem"
  cp "$keystore/public/ca.cert.pem" "$folder/permissions_ca.cert.pem"
  cp "$keystore/enclaves/governance.p7s" "$folder/governance.p7s"
done
rm -f "$keystore/openssl.log"
